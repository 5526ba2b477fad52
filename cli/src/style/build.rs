//! `troupe style build`.

use std::path::Path;

use troupe_client::{Client, Pack};
use troupe_proto::v1;

use super::args::Build;
use super::extract::{GaitSource, stands};
use super::json;
use super::list::{StyleEntry, StyleList};
use super::rebuild::rebuild;
use crate::context::Context;
use crate::failure::Failure;
use crate::files::clip_in;
use crate::reading::Reading;

pub(super) async fn run(context: &Context, command: &Build) -> Result<(), Failure> {
    let list = StyleList::read(&command.list)?;
    if let Some(name) = command.only.iter().find(|name| !list.styles.contains_key(*name)) {
        return Err(Failure::file(
            &command.list,
            format_args!("no style `{name}` in it"),
        ));
    }
    let (client, pack) = context.connect_to_pack(&command.pack).await?;
    std::fs::create_dir_all(&command.out).map_err(|e| Failure::output(&command.out, e))?;
    let builder = Builder {
        context,
        client: &client,
        pack: &pack,
        reading: &command.reading,
        keys: command.building.keys as usize,
    };
    for (name, entry) in &list.styles {
        if !command.only.is_empty() && !command.only.contains(name) {
            continue;
        }
        let style = builder.listed(name, entry, &command.data).await?;
        write(&style, &command.out.join(format!("{name}.json")))?;
    }
    Ok(())
}

/// Writes a style's file.
pub(super) fn write(style: &v1::Style, path: &Path) -> Result<(), Failure> {
    let text = json::to_file(style).map_err(|e| Failure::Other(e.to_string()))?;
    std::fs::write(path, text).map_err(|e| Failure::output(path, e))
}

/// Makes gaits with one pack.
pub(super) struct Builder<'a> {
    pub(super) context: &'a Context,
    pub(super) client: &'a Client,
    pub(super) pack: &'a Pack,
    pub(super) reading: &'a Reading,
    /// Keys of a gait that moves.
    pub(super) keys: usize,
}

impl Builder<'_> {
    /// Makes one gait and says what came of it. Several places are several ways to stand.
    pub(super) async fn gait(
        &self,
        style: &str,
        name: &str,
        places: &[GaitSource<'_>],
    ) -> Result<v1::Gait, Failure> {
        let term = &self.context.term;
        let mut cycles = Vec::with_capacity(places.len());
        let mut found = Vec::with_capacity(places.len());
        for place in places {
            let extracted = place.extract(self.pack, self.reading, term)?;
            let file = place.path.file_name().unwrap_or_default().to_string_lossy();
            found.push(format!("{file} from frame {}", extracted.start));
            cycles.push(extracted);
        }
        let cycles_only: Vec<_> = cycles.iter().map(|e| &e.cycle).collect();
        let rebuilt = rebuild(self.client, self.pack, name, &cycles_only, self.keys).await?;
        let gait = &rebuilt.gait;
        let closure_m = cycles.iter().map(|e| e.closure_m).fold(0.0, f32::max);
        term.note(format_args!(
            "{style} {name}: {}; {} frames, forward {:.2} left {:.2} m/s, turn {:.2} rad/s, ends {:.1} cm apart; {} key poses \
             rebuilt, {:.1} cm from the clip",
            found.join(", "),
            gait.period_frames,
            gait.forward,
            gait.left,
            gait.turn,
            closure_m * 100.0,
            gait.keys.len(),
            rebuilt.distance_m * 100.0,
        ));
        Ok(rebuilt.gait)
    }

    async fn listed(&self, name: &str, entry: &StyleEntry, data: &Path) -> Result<v1::Style, Failure> {
        let mut gaits = Vec::with_capacity(entry.gaits.len());
        for (gait, listed) in &entry.gaits {
            let parts = listed.parts();
            if parts.len() != 1 && !stands(gait) {
                return Err(Failure::Input(format!(
                    "style `{name}`: the gait `{gait}` names {} clips; only gaits that stand may have several",
                    parts.len()
                )));
            }
            let paths: Vec<_> = parts.iter().map(|p| clip_in(data, &p.clip, self.pack)).collect();
            let places: Vec<GaitSource<'_>> = parts
                .iter()
                .zip(&paths)
                .map(|(part, path)| {
                    let (from, to) = part.frames();
                    GaitSource { path, gait, from, to }
                })
                .collect();
            gaits.push(self.gait(name, gait, &places).await?);
        }
        gaits.sort_by_key(order);
        let named = |wanted: &str| gaits.iter().find(|g| g.name == wanted);
        let of = match &entry.speed_of {
            Some(gait) => Some(named(gait).ok_or_else(|| {
                Failure::Input(format!(
                    "style `{name}`: speed_of names the gait `{gait}`, which it does not have"
                ))
            })?),
            None => named("walk").or(gaits.iter().find(|g| !stands(&g.name))),
        };
        Ok(v1::Style {
            name: name.to_owned(),
            default_speed: of.map_or(0.0, speed),
            replan_interval_frames: entry.replan_interval_frames,
            is_static: entry.is_static,
            root_ratio: entry.root_ratio,
            gaits,
            ..v1::Style::default()
        })
    }
}

/// The order in which gaits are kept: those that stand, then those that go, each by what one looks
/// for first.
fn order(gait: &v1::Gait) -> (usize, String) {
    const FIRST: [&str; 4] = ["idle", "walk", "run", "dash"];
    let place = FIRST.iter().position(|name| gait.name == *name);
    (place.unwrap_or(FIRST.len()), gait.name.clone())
}

/// Speed of a gait over the ground, m/s.
pub(super) fn speed(gait: &v1::Gait) -> f32 {
    gait.left.hypot(gait.forward)
}
