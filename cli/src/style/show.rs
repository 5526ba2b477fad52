//! `troupe style list` and `troupe style show`.

use comfy_table::{Cell, CellAlignment, ContentArrangement, Table, presets};
use troupe_proto::v1;

use super::args::{List, Show};
use super::build::speed;
use super::json;
use crate::context::Context;
use crate::failure::Failure;
use crate::output::print;

pub(super) async fn list(context: &Context, command: &List) -> Result<(), Failure> {
    let (client, pack) = context.connect_to_pack(&command.pack).await?;
    let styles = client.styles(&pack).await?;
    if command.json {
        let json = serde_json::to_string_pretty(&styles).map_err(|e| Failure::Other(e.to_string()))?;
        return print(&json);
    }
    print(&table_of_styles(&styles).to_string())
}

pub(super) async fn show(context: &Context, command: &Show) -> Result<(), Failure> {
    let (client, pack) = context.connect_to_pack(&command.pack).await?;
    let style = client.style(&pack, &command.name).await?;
    if command.json {
        let json = json::to_file(&style).map_err(|e| Failure::Other(e.to_string()))?;
        return print(json.trim_end());
    }
    print(&describe(&style))
}

fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_style(presets::UTF8_FULL_CONDENSED)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_header(header.iter().copied());
    if table.width().is_none() {
        // Not on a terminal.
        table.set_width(120);
    }
    table
}

fn number(text: String) -> Cell {
    Cell::new(text).set_alignment(CellAlignment::Right)
}

fn table_of_styles(styles: &v1::ListStylesResponse) -> Table {
    let mut table = table(&["style", "speed m/s", "gaits", "from"]);
    for style in &styles.styles {
        let default = if style.name == styles.default_style {
            " (default)"
        } else {
            ""
        };
        let gaits: Vec<&str> = style.gaits.iter().map(|g| g.name.as_str()).collect();
        table.add_row([
            Cell::new(format!("{}{default}", style.name)),
            number(format!("{:.2}", style.default_speed)),
            Cell::new(gaits.join(", ")),
            Cell::new(if style.built_in { "the pack" } else { "added" }),
        ]);
    }
    table
}

/// A style in words and a table of its gaits.
fn describe(style: &v1::Style) -> String {
    let counts = style
        .allowed_token_counts
        .iter()
        .map(u32::to_string)
        .collect::<Vec<_>>();
    let mut text = format!(
        "{}, {}\ndefault speed {:.2} m/s, {}",
        style.name,
        if style.built_in {
            "of the pack"
        } else {
            "added to the pack"
        },
        style.default_speed,
        if style.is_static {
            "stands still".to_owned()
        } else {
            format!("plans every {} frames", style.replan_interval_frames)
        },
    );
    if !counts.is_empty() {
        text.push_str(&format!(", plans of {} tokens", counts.join(", ")));
    }
    if style.root_ratio > 0.0 {
        text.push_str(&format!(", root ratio {:.2}", style.root_ratio));
    }
    let mut table = table(&[
        "gait",
        "speed m/s",
        "forward m/s",
        "left m/s",
        "turn °/s",
        "period frames",
        "height m",
        "keys",
    ]);
    for gait in &style.gaits {
        table.add_row([
            Cell::new(&gait.name),
            number(format!("{:.2}", speed(gait))),
            number(format!("{:.2}", gait.forward)),
            number(format!("{:.2}", gait.left)),
            number(format!("{:.0}", gait.turn.to_degrees())),
            number(format!("{:.0}", gait.period_frames)),
            number(format!("{:.3}", gait.height)),
            number(gait.key_count.to_string()),
        ]);
    }
    format!("{text}\n{table}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn style() -> v1::Style {
        let gait = |name: &str, forward, turn, period_frames| v1::Gait {
            name: name.to_owned(),
            forward,
            left: 0.05,
            turn,
            period_frames,
            key_count: 12,
            height: 0.912,
            ..v1::Gait::default()
        };
        v1::Style {
            name: "sneak".to_owned(),
            default_speed: 0.71,
            replan_interval_frames: 9,
            allowed_token_counts: vec![8, 9],
            root_ratio: 0.4,
            gaits: vec![
                gait("idle", 0.0, 0.0, 0.0),
                gait("walk-turn-left", 0.71, 0.8, 34.0),
            ],
            ..v1::Style::default()
        }
    }

    #[test]
    fn a_style_in_words() {
        insta::assert_snapshot!(describe(&style()));
    }

    #[test]
    fn styles_in_a_table() {
        let styles = v1::ListStylesResponse {
            body: String::new(),
            pack: "human".to_owned(),
            styles: vec![
                v1::Style {
                    name: "normal".to_owned(),
                    built_in: true,
                    ..style()
                },
                style(),
            ],
            default_style: "normal".to_owned(),
        };
        insta::assert_snapshot!(table_of_styles(&styles).to_string());
    }
}
