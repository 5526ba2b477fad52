//! `troupe packs`.

mod life;

use clap::Args;
use comfy_table::Cell;
use serde_json::{Value, json};
use troupe_client::Pack;
use troupe_proto::v1;

use self::life::Change;
use crate::context::Context;
use crate::failure::Failure;
use crate::output::{print, table};

/// List the packs that the server has loaded, describe one, or load, unload and swap them.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_long_help = "\
Examples:
  troupe packs
  troupe packs human
  troupe packs human --json | jq .figures
  troupe packs swap human 0.4.0"
)]
pub(crate) struct Packs {
    #[command(subcommand)]
    change: Option<Change>,

    /// Describe this pack: skeleton, limits, licence, credits, training and evaluation figures.
    pub(crate) name: Option<String>,

    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

pub(super) async fn run(context: &Context, command: &Packs) -> Result<(), Failure> {
    if let Some(change) = &command.change {
        return life::run(context, change).await;
    }
    let client = context.connect().await?;
    let text = match &command.name {
        Some(name) => {
            let pack = client.pack(name).await?;
            if command.json {
                pretty(&to_json(&pack))
            } else {
                describe(&pack)
            }
        }
        None => {
            let packs = client.packs().await?;
            if command.json {
                pretty(&packs.iter().map(to_json).collect())
            } else {
                list(&packs)
            }
        }
    };
    print(&text)
}

fn pretty(value: &Value) -> String {
    format!("{value:#}")
}

/// The figures as in the manifest. Nothing if they are not JSON.
fn figures(pack: &Pack) -> Value {
    serde_json::from_str(&pack.description().figures_json).unwrap_or_default()
}

fn to_json(pack: &Pack) -> Value {
    let of = pack.description();
    json!({
        "name": of.name,
        "version": of.version,
        "default": of.is_default,
        "licence": of.licence,
        "credits": of.credits,
        "fps": of.fps,
        "joints": of.joints.iter().map(|j| json!({"name": j.name, "parent": j.parent})).collect::<Value>(),
        "contact_joints": of.contact_joints,
        "context_frames": of.context_frames,
        "max_targets": of.max_targets,
        "min_frames": of.min_frames,
        "max_frames": of.max_frames,
        "frames_per_token": of.frames_per_token,
        "heads": of.heads,
        "codes": of.codes,
        "parameters": of.parameters,
        "content_hash": of.content_hash,
        "robot": of.robot.as_ref().map(robot_json),
        "skills": of.skills.iter().map(skill_json).collect::<Value>(),
        "figures": figures(pack),
    })
}

fn skill_json(skill: &v1::PackSkill) -> Value {
    json!({
        "name": skill.name,
        "description": skill.description,
        "variants": skill.variants,
        "held": skill.held,
    })
}

/// The skills of characters, one a line.
fn skills_in_words(skills: &[v1::PackSkill]) -> String {
    let skill = |skill: &v1::PackSkill| {
        let held = if skill.held { ", held until ended" } else { "" };
        format!(
            "{} ({}{held}): {}",
            skill.name,
            skill.variants.join(", "),
            skill.description
        )
    };
    skills.iter().map(skill).collect::<Vec<_>>().join("\n")
}

fn robot_json(robot: &v1::Robot) -> Value {
    let hinge = |hinge: &v1::Hinge| {
        json!({
            "joint": hinge.joint,
            "lower_rad": hinge.lower,
            "upper_rad": hinge.upper,
            "max_speed_rad_per_s": hinge.max_speed,
            "max_acceleration_rad_per_s2": hinge.max_acceleration,
        })
    };
    json!({
        "name": robot.name,
        "qpos_size": robot.qpos_size,
        "hinges": robot.hinges.iter().map(hinge).collect::<Value>(),
    })
}

/// A robot's hinges, one a line, with their limits.
fn robot_in_words(robot: &v1::Robot) -> String {
    let hinge = |hinge: &v1::Hinge| {
        let change = hinge.max_acceleration;
        let change = change.map_or_else(String::new, |most| format!(" and {most} rad/s²"));
        format!(
            "{}: {} to {} rad, at most {} rad/s{change}",
            hinge.joint, hinge.lower, hinge.upper, hinge.max_speed
        )
    };
    let hinges = robot.hinges.iter().map(hinge).collect::<Vec<_>>();
    format!(
        "{}: {} hinges, qpos of {} numbers\n{}",
        robot.name,
        hinges.len(),
        robot.qpos_size,
        hinges.join("\n")
    )
}

fn list(packs: &[Pack]) -> String {
    let mut table = table();
    table.set_header([
        "pack",
        "version",
        "joints",
        "fps",
        "segment frames",
        "parameters",
        "licence",
    ]);
    for pack in packs {
        let of = pack.description();
        let name = if of.is_default {
            format!("{} (default)", of.name)
        } else {
            of.name.clone()
        };
        table.add_row([
            Cell::new(name),
            Cell::new(&of.version),
            Cell::new(of.joints.len()),
            Cell::new(of.fps),
            Cell::new(format!("{} to {}", of.min_frames, of.max_frames)),
            Cell::new(millions(of.parameters)),
            Cell::new(&of.licence),
        ]);
    }
    table.to_string()
}

fn describe(pack: &Pack) -> String {
    let of = pack.description();
    let mut table = table();
    let joints = of
        .joints
        .iter()
        .map(|j| j.name.as_str())
        .collect::<Vec<_>>()
        .join(", ");
    let name = if of.is_default {
        format!("{} (default)", of.name)
    } else {
        of.name.clone()
    };
    for (what, text) in [
        ("name", name),
        ("version", of.version.clone()),
        ("licence", of.licence.clone()),
        ("credits", of.credits.join("\n")),
        ("frames per second", of.fps.to_string()),
        ("context frames", of.context_frames.to_string()),
        ("target keyframes", format!("1 to {}", of.max_targets)),
        (
            "segment frames",
            format!("{} to {}", of.min_frames, of.max_frames),
        ),
        (
            "tokens",
            format!(
                "{} heads of {} codes, {} frames each",
                of.heads, of.codes, of.frames_per_token
            ),
        ),
        ("parameters", millions(of.parameters)),
        ("joints", format!("{}: {joints}", of.joints.len())),
        ("contact joints", of.contact_joints.join(", ")),
        ("content", of.content_hash.clone()),
    ] {
        table.add_row([what, &text]);
    }
    if let Some(robot) = &of.robot {
        table.add_row(["robot", &robot_in_words(robot)]);
    }
    if !of.skills.is_empty() {
        table.add_row(["skills", &skills_in_words(&of.skills)]);
    }
    for (name, figure) in figure_rows(&figures(pack)) {
        table.add_row([name, figure]);
    }
    table.to_string()
}

/// The manifest's figures, a row each: a table inside a table becomes one row.
fn figure_rows(figures: &Value) -> Vec<(String, String)> {
    let sections = figures.as_object().into_iter().flatten();
    sections
        .flat_map(|(section, entries)| {
            let entries = entries.as_object().into_iter().flatten();
            entries
                .map(move |(key, value)| (format!("{section}: {}", key.replace('_', " ")), in_words(value)))
        })
        .collect()
}

fn in_words(value: &Value) -> String {
    match value {
        Value::Object(entries) => {
            let entries = entries
                .iter()
                .map(|(key, value)| format!("{key} {}", in_words(value)));
            entries.collect::<Vec<_>>().join(", ")
        }
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

fn millions(parameters: u64) -> String {
    format!("{:.1} M", parameters as f64 / 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_is_shown_with_its_limits() {
        let message = crate::testing::hopper();
        let pack = Pack::try_from(message.clone()).unwrap();
        let words = robot_in_words(message.robot.as_ref().unwrap());
        assert_eq!(
            words,
            "hopper: 1 hinges, qpos of 8 numbers\nFoot: -0.5 to 1.5 rad, at most 10 rad/s"
        );
        assert!(describe(&pack).contains("qpos of 8 numbers"));
        let json = to_json(&pack);
        assert_eq!(json["robot"]["hinges"][0]["upper_rad"], 1.5);
        assert_eq!(json["robot"]["qpos_size"], 8);
        let human = Pack::try_from(crate::testing::pair()).unwrap();
        assert_eq!(to_json(&human)["robot"], Value::Null);
    }

    #[test]
    fn skills_are_shown_with_their_ways() {
        let lie = v1::PackSkill {
            name: "lie-down".to_owned(),
            description: "Lies down.".to_owned(),
            variants: vec!["back".to_owned(), "front".to_owned()],
            held: true,
        };
        let jump = v1::PackSkill {
            name: "jump".to_owned(),
            description: "Jumps.".to_owned(),
            variants: vec!["up".to_owned()],
            held: false,
        };
        let message = v1::Pack {
            skills: vec![jump, lie],
            ..crate::testing::pair()
        };
        let pack = Pack::try_from(message).unwrap();
        let words = skills_in_words(&pack.description().skills);
        assert_eq!(
            words,
            "jump (up): Jumps.\nlie-down (back, front, held until ended): Lies down."
        );
        assert!(describe(&pack).contains("lie-down (back, front"));
        assert_eq!(to_json(&pack)["skills"][1]["held"], true);
    }

    #[test]
    fn figures_have_a_row_each_and_inner_tables_one_together() {
        let value = json!({
            "training": {"steps": 20, "data": "walks"},
            "evaluation": {"gap_15_pack": {"l2p_m": 0.1, "npss": 0.02}},
            "nothing": null,
        });
        let expected = [
            ("evaluation: gap 15 pack", "l2p_m 0.1, npss 0.02"),
            ("training: data", "walks"),
            ("training: steps", "20"),
        ];
        assert_eq!(
            figure_rows(&value),
            expected.map(|(name, text)| (name.to_owned(), text.to_owned()))
        );
    }
}
