//! What streams hear, whether they drive or watch.

use tokio::sync::watch;
use troupe_proto::v1;

use crate::session::stream::Said;
use crate::session::{Sessions, commands};
use crate::wire::units;
use troupe_character::live::CommandOutcome;
use troupe_character::{FieldError, Path};

/// Ends when the server shuts down.
pub(super) async fn drained(draining: &mut watch::Receiver<bool>) {
    if draining.wait_for(|draining| *draining).await.is_err() {
        // The sender is gone with the server's handle; the server itself goes on.
        std::future::pending().await
    }
}

/// Gives a client's commands to the characters. Those that were accepted are not told of.
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
