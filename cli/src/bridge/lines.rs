//! The lines of standard input, read ahead within limits.

use std::io::{BufRead, Read as _};

use tokio::sync::mpsc::{Receiver, Sender, channel};

/// Lines that are read ahead. Others wait where they come from.
const AHEAD: usize = 64;
/// Longest line, bytes. A path of 1024 places has 20,000.
const LONGEST: u64 = 1 << 16;

/// Reads standard input until the receiver is gone. A line that is too long becomes a sentence that
/// says so.
pub(super) fn lines() -> Receiver<Result<String, String>> {
    let (send, receive) = channel(AHEAD);
    std::thread::spawn(move || forward(std::io::stdin().lock(), &send));
    receive
}

fn forward(mut input: impl BufRead, send: &Sender<Result<String, String>>) {
    // An input that cannot be read has ended.
    while let Ok(Some(line)) = next(&mut input) {
        if send.blocking_send(line).is_err() {
            return;
        }
    }
}

/// The next line, without its end. None at the end of the input.
fn next(input: &mut impl BufRead) -> std::io::Result<Option<Result<String, String>>> {
    let mut bytes = Vec::new();
    if input.by_ref().take(LONGEST + 1).read_until(b'\n', &mut bytes)? == 0 {
        return Ok(None);
    }
    if bytes.pop_if(|last| *last == b'\n').is_none() && bytes.len() as u64 > LONGEST {
        input.skip_until(b'\n')?;
        return Ok(Some(Err(format!(
            "a line of more than {LONGEST} bytes; allowed: an order of at most as many"
        ))));
    }
    let line = String::from_utf8(bytes);
    Ok(Some(line.map_err(|_| {
        "a line that is not UTF-8; allowed: an order in UTF-8".to_owned()
    })))
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    #[test]
    fn lines_end_and_long_ones_are_skipped() {
        let long = "x".repeat(LONGEST as usize);
        let text = format!("start\n\n{long}\n{long}y\nwalk 1 0\n\u{e9}nd");
        let mut input = Cursor::new(text.into_bytes());
        let mut read = || next(&mut input).unwrap();
        assert_eq!(read(), Some(Ok("start".to_owned())));
        assert_eq!(read(), Some(Ok(String::new())));
        assert_eq!(read(), Some(Ok(long.clone())));
        let error = read().unwrap().unwrap_err();
        assert!(error.starts_with("a line of more than 65536 bytes"), "{error}");
        assert_eq!(read(), Some(Ok("walk 1 0".to_owned())));
        assert_eq!(read(), Some(Ok("\u{e9}nd".to_owned())));
        assert_eq!(read(), None);
        let mut other = Cursor::new(b"\xff\nstop\n");
        assert!(
            next(&mut other)
                .unwrap()
                .unwrap()
                .unwrap_err()
                .contains("not UTF-8")
        );
        assert_eq!(next(&mut other).unwrap(), Some(Ok("stop".to_owned())));
    }

    #[tokio::test]
    async fn lines_without_a_place_are_not_read() {
        struct Endless(std::sync::Arc<std::sync::atomic::AtomicUsize>);
        impl std::io::Read for Endless {
            fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
                self.0.fetch_add(1, std::sync::atomic::Ordering::SeqCst);
                into[..5].copy_from_slice(b"stop\n");
                Ok(5)
            }
        }
        let count = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(0));
        let (send, mut receive) = channel(AHEAD);
        let input = std::io::BufReader::new(Endless(count.clone()));
        let reader = std::thread::spawn(move || forward(input, &send));
        for _ in 0..3 {
            assert_eq!(receive.recv().await, Some(Ok("stop".to_owned())));
        }
        // Three that were taken, those that wait, and one that has no place yet.
        let read = || count.load(std::sync::atomic::Ordering::SeqCst);
        while read() < 3 + AHEAD + 1 {
            tokio::time::sleep(std::time::Duration::from_millis(1)).await;
        }
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
        assert_eq!(read(), 3 + AHEAD + 1);
        drop(receive);
        reader.join().unwrap();
    }
}
