//! Messages that every stream handles, whether it drives sessions or watches them.

use tokio::sync::watch;
use troupe_proto::v1;

use crate::session::stream::Said;
use crate::session::{Sessions, commands};
use crate::wire::units;
use troupe_character::live::CommandOutcome;
use troupe_character::{FieldError, Path};

/// Returns when the server shuts down.
pub(super) async fn drained(draining: &mut watch::Receiver<bool>) {
    if draining.wait_for(|draining| *draining).await.is_err() {
        // The handle of the server was dropped, but the server still runs: wait forever.
        std::future::pending().await
    }
}

/// Gives a client's commands to the characters. The answer lists only commands that were not simply
/// accepted.
pub(super) async fn command(
    sessions: &Sessions,
    request: &v1::CommandRequest,
) -> Result<Option<Said>, FieldError> {
    let root = Path::root();
    let path = root.field("command");
    let commands = &path.field("commands");
    units::length(commands, request.commands.len(), 1, commands::MAX_COMMANDS)?;
    let mut results = sessions.apply(&request.commands).await;
    results.retain(|result| !matches!(result.outcome, Ok(CommandOutcome::Accepted)));
    Ok((!results.is_empty()).then_some(Said::Commands(results)))
}
