//! Reads files again while the server runs, if they change.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use sha2::{Digest as _, Sha256};
use tokio::sync::Notify;

/// Time between two looks at the files. The streams of a removed key end within a second.
const LOOK_INTERVAL: Duration = Duration::from_millis(500);

type Fingerprint = [u8; 32];
type Read = Box<dyn Fn() -> Result<(), String> + Send + Sync>;

/// Data that is read from files.
pub struct Source {
    /// Name in the log, plural.
    what: &'static str,
    files: Vec<PathBuf>,
    seen: Fingerprint,
    read: Read,
}

impl Source {
    /// Data whose files have just been read. `seen` is their fingerprint from before that. `read`
    /// reads them again, and returns an error if it cannot.
    pub fn new<E: std::error::Error>(
        what: &'static str,
        files: Vec<PathBuf>,
        seen: Fingerprint,
        read: impl Fn() -> Result<(), E> + Send + Sync + 'static,
    ) -> Self {
        let read = Box::new(move || read().map_err(|error| error.to_string()));
        Self {
            what,
            files,
            seen,
            read,
        }
    }

    /// Reads the files again if they have changed, or if `anyway`.
    fn look(&mut self, anyway: bool) {
        let now = fingerprint(&self.files);
        if now == self.seen && !anyway {
            return;
        }
        self.seen = now;
        match (self.read)() {
            Ok(()) => tracing::info!(files = ?self.files, "{} read again", self.what),
            Err(error) => tracing::warn!(
                "{} cannot be read again, the old ones stay in use: {error}",
                self.what
            ),
        }
    }
}

/// A hash of the contents of `files`. Their times would not do: some tools replace several files at
/// once by changing a link to their folder.
pub fn fingerprint(files: &[PathBuf]) -> Fingerprint {
    let mut hash = Sha256::new();
    for file in files {
        let text = std::fs::read(file).unwrap_or_default();
        hash.update(text.len().to_le_bytes());
        hash.update(&text);
    }
    hash.finalize().into()
}

/// Reads each source again when its files change, and all of them when `now` is notified.
pub async fn watch(mut sources: Vec<Source>, now: Arc<Notify>) {
    if sources.is_empty() {
        return;
    }
    loop {
        let anyway = tokio::select! {
            () = now.notified() => true,
            () = tokio::time::sleep(LOOK_INTERVAL) => false,
        };
        let look = move || {
            sources.iter_mut().for_each(|source| source.look(anyway));
            sources
        };
        sources = match tokio::task::spawn_blocking(look).await {
            Ok(sources) => sources,
            Err(error) => return tracing::error!(%error, "files are no longer read again"),
        };
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn a_source_is_read_again_when_its_files_change() {
        let folder = tempfile::tempdir().unwrap();
        let files = vec![folder.path().join("a"), folder.path().join("b")];
        let write = |index: usize, text: &str| std::fs::write(&files[index], text).unwrap();
        write(0, "one");
        let count = Arc::new(AtomicUsize::new(0));
        let counted = count.clone();
        let read = move || match counted.fetch_add(1, Ordering::Relaxed) {
            2 => Err(std::io::Error::other("broken")),
            _ => Ok(()),
        };
        let mut source = Source::new("files", files.clone(), fingerprint(&files), read);
        let mut look = |anyway| {
            source.look(anyway);
            count.load(Ordering::Relaxed)
        };
        assert_eq!(look(false), 0);
        write(0, "two");
        assert_eq!((look(false), look(false)), (1, 1));
        // The same bytes in another file are another state.
        write(1, "two");
        write(0, "");
        assert_eq!((look(false), look(true)), (2, 3));
        // The third reading failed. It is not tried again until something changes.
        assert_eq!(look(false), 3);
        write(1, "three");
        assert_eq!(look(false), 4);
    }
}
