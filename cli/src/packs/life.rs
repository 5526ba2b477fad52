//! `troupe packs load`, `unload` and `swap`.

use clap::{Args, Subcommand};
use troupe_proto::v1;

use crate::context::Context;
use crate::failure::Failure;
use crate::output::{print, to_json};

/// What becomes of a pack of the server.
#[derive(Debug, Subcommand)]
pub(crate) enum Change {
    /// Load a pack from the server's folder of packs.
    ///
    /// If it is loaded already, nothing changes. If it cannot serve, the answer says why. On a
    /// server with keys this needs the role admin.
    Load(Which),

    /// Unload a pack.
    ///
    /// New requests do not find it. Calls under way and live sessions keep it until they end. On a
    /// server with keys this needs the role admin.
    Unload(Which),

    /// Replace a loaded pack by another version.
    ///
    /// New requests and the next plans of live sessions get the new version. If it cannot serve,
    /// the old version stays. On a server with keys this needs the role admin.
    Swap(Which),
}

/// A pack of the server.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe packs load unimogen
  troupe packs swap human 0.4.0
  troupe packs unload vermo")]
pub(crate) struct Which {
    /// The name in the pack's manifest.
    name: String,

    /// The version in its manifest. Left out: the newest in the server's folder of packs. For
    /// `unload`: the loaded version.
    // `--version` has the id `version`.
    #[arg(id = "pack_version", value_name = "VERSION")]
    version: Option<String>,

    /// Print JSON.
    #[arg(long)]
    json: bool,
}

pub(super) async fn run(context: &Context, change: &Change) -> Result<(), Failure> {
    let client = context.connect().await?;
    let (Change::Load(which) | Change::Unload(which) | Change::Swap(which)) = change;
    let (name, version) = (which.name.as_str(), which.version.as_deref().unwrap_or_default());
    let done = match change {
        Change::Load(_) => client.load_pack(name, version).await?,
        Change::Unload(_) => client.unload_pack(name, version).await?,
        Change::Swap(_) => client.swap_pack(name, version).await?,
    };
    match which.json {
        true => print(&to_json(&done)?),
        false => print(&in_words(change, &done)),
    }
}

/// What became of the pack, and which packs wait for their last users.
fn in_words(change: &Change, done: &v1::PackChange) -> String {
    let (pack, version) = (&done.name, &done.version);
    let mib = done.estimated_bytes.div_ceil(1 << 20);
    let mut text = match (change, done.changed, &done.replaced_version) {
        (Change::Unload(_), true, _) => format!("{pack} {version} is unloaded"),
        (Change::Unload(_), false, _) => format!("{pack} was not loaded"),
        (_, true, Some(before)) => {
            format!("{pack} {version} serves in the place of {before}; its networks take about {mib} MiB")
        }
        (_, true, None) => format!("{pack} {version} serves; its networks take about {mib} MiB"),
        (_, false, _) => format!("{pack} {version} serves already"),
    };
    for left in &done.leaving {
        text.push_str(&format!(
            "\n{} {} is still in memory, for calls or sessions; unloaded {} s ago",
            left.name,
            left.version,
            left.held_ms / 1000
        ));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_shown_in_words() {
        let which = || Which {
            name: "human".to_owned(),
            version: None,
            json: false,
        };
        let mut done = v1::PackChange {
            name: "human".to_owned(),
            version: "2".to_owned(),
            changed: true,
            replaced_version: Some("1".to_owned()),
            estimated_bytes: (3 << 20) + 1,
            leaving: vec![v1::LeavingPack {
                name: "human".to_owned(),
                version: "1".to_owned(),
                held_ms: 2500,
            }],
        };
        assert_eq!(
            in_words(&Change::Swap(which()), &done),
            "human 2 serves in the place of 1; its networks take about 4 MiB\n\
             human 1 is still in memory, for calls or sessions; unloaded 2 s ago"
        );
        done.leaving.clear();
        done.replaced_version = None;
        assert_eq!(
            in_words(&Change::Load(which()), &done),
            "human 2 serves; its networks take about 4 MiB"
        );
        assert_eq!(in_words(&Change::Unload(which()), &done), "human 2 is unloaded");
        done.changed = false;
        assert_eq!(in_words(&Change::Load(which()), &done), "human 2 serves already");
        assert_eq!(in_words(&Change::Unload(which()), &done), "human was not loaded");
    }
}
