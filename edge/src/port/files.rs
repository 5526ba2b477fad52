//! The limit of connections that follows from the system's limit of open files.

use super::slots::RESERVE;

/// Most connections if the option is 0.
const USUAL_CONNECTIONS: usize = 10_000;
/// Files that the server opens besides connections: libraries, packs, scenes, the log.
const OTHER_FILES: u64 = 256;

/// The option asks for more connections than the limit of open files allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "max_connections is {asked}, and the limit of open files (ulimit -n) is {files}; allowed: 0 to {room}, or more with a \
     higher limit"
)]
pub struct TooFewFiles {
    /// Value of the option `max_connections`.
    pub asked: usize,
    /// The process's limit of open files.
    pub files: u64,
    /// Most connections within this limit.
    pub room: usize,
}

/// The limit of connections: `asked`, or if that is 0, the usual number or as many as there is room
/// for. Raises this process's limit of open files as far as the system allows.
///
/// # Errors
/// [`TooFewFiles`] if there is no room for `asked` connections.
pub fn max_connections(asked: usize) -> Result<usize, TooFewFiles> {
    match rlimit::increase_nofile_limit(u64::MAX) {
        Ok(files) => fit(asked, files),
        Err(error) => {
            tracing::warn!(%error, "cannot read the limit of open files");
            Ok(if asked == 0 { USUAL_CONNECTIONS } else { asked })
        }
    }
}

fn fit(asked: usize, files: u64) -> Result<usize, TooFewFiles> {
    let room = files.saturating_sub(OTHER_FILES + RESERVE as u64);
    let room = usize::try_from(room).unwrap_or(usize::MAX);
    match asked {
        0 if room < USUAL_CONNECTIONS => {
            let lowered = room.max(1);
            tracing::warn!(
                max_connections = lowered,
                open_files = files,
                "the limit of open files (ulimit -n) leaves room for fewer connections than usual"
            );
            Ok(lowered)
        }
        0 => Ok(USUAL_CONNECTIONS),
        asked if asked > room => Err(TooFewFiles { asked, files, room }),
        asked => Ok(asked),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_fit_into_the_limit_of_open_files() {
        assert_eq!(fit(0, u64::MAX).unwrap(), USUAL_CONNECTIONS);
        assert_eq!(fit(0, 1024).unwrap(), 752);
        assert_eq!(fit(0, 10).unwrap(), 1);
        assert_eq!(fit(752, 1024).unwrap(), 752);
        assert_eq!(
            fit(20_000, 4096).unwrap_err().to_string(),
            "max_connections is 20000, and the limit of open files (ulimit -n) is 4096; allowed: 0 to 3824, or more with a \
             higher limit"
        );
    }
}
