//! Open sessions without any calls. They show how much memory the server needs for a session.

use std::sync::Arc;

use super::sessions::{Opened, open_idle};
use crate::failure::Failure;
use crate::measure::Recorder;
use crate::plan::{Plan, Share};

/// The open sessions of a share.
#[derive(Debug)]
pub struct Idle {
    opened: Opened,
}

impl Idle {
    pub(super) async fn prepare(
        plan: &Plan,
        share: Share,
        characters: u32,
        pack: &str,
    ) -> Result<Self, Failure> {
        Ok(Self {
            opened: open_idle(plan, pack, share.part(characters)).await?,
        })
    }

    pub(super) async fn carry_out(self, recorder: &Arc<Recorder>) -> Result<(), Failure> {
        let characters = self.opened.count() as u64;
        recorder.live(|live| live.characters = characters);
        tokio::time::sleep_until(recorder.clock().end()).await;
        let checked = self.opened.check(recorder).await;
        let closed = self.opened.close().await;
        checked?;
        closed
    }
}
