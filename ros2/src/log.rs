//! Notes about a robot, to standard error and to `/rosout`.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use ros2_client::builtin_interfaces::Time;
use ros2_client::log::LogLevel;
use ros2_client::rosout::{NodeLoggingHandle, RosoutRaw as _};

/// The same note comes at most this often.
const AGAIN: Duration = Duration::from_secs(5);

/// The log of one robot. Clones share it.
#[derive(Clone)]
pub(crate) struct Log {
    robot: Arc<str>,
    handle: Arc<NodeLoggingHandle>,
    last: Arc<Mutex<Option<(String, Instant)>>>,
}

impl Log {
    pub(crate) fn new(robot: &str, handle: NodeLoggingHandle) -> Self {
        Self {
            robot: robot.into(),
            handle: Arc::new(handle),
            last: Arc::default(),
        }
    }

    pub(crate) fn info(&self, text: &str) {
        tracing::info!("{}: {text}", self.robot);
        self.write(LogLevel::Info, text);
    }

    /// Warns, unless that was the last warning a moment ago.
    pub(crate) fn warn(&self, text: &str) {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if is_news(last.as_ref(), text, Instant::now()) {
            *last = Some((text.to_owned(), Instant::now()));
            tracing::warn!("{}: {text}", self.robot);
            self.write(LogLevel::Warn, text);
        }
    }

    fn write(&self, level: LogLevel, text: &str) {
        let (name, file, line) = (format!("{}.troupe", self.robot), file!(), line!());
        self.handle
            .rosout_raw(Time::now(), level, &name, text, file, "", line);
    }
}

/// Whether a warning differs from the last one, or that one was a while ago.
fn is_news(last: Option<&(String, Instant)>, text: &str, now: Instant) -> bool {
    last.is_none_or(|(before, when)| before != text || now.saturating_duration_since(*when) >= AGAIN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_warning_comes_every_five_seconds() {
        let now = Instant::now();
        let last = ("late".to_owned(), now);
        assert!(is_news(None, "late", now));
        assert!(!is_news(Some(&last), "late", now + Duration::from_millis(4999)));
        assert!(is_news(Some(&last), "late", now + AGAIN));
        assert!(is_news(Some(&last), "gone", now));
    }
}
