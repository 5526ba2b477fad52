//! `troupe scene`.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use comfy_table::{Cell, Table};
use troupe_motion::conventions::Convention;
use troupe_proto::v1;

use crate::context::Context;
use crate::failure::Failure;
use crate::files::{document_failure, read_document};
use crate::output::{print, table, to_json};

/// Put scenes on the server, and show those that it has: what characters stand on and use.
///
/// Colliders carry characters, are in the way to objects, and are what things are put on. They do
/// not stop locomotion.
#[derive(Debug, Args)]
pub(super) struct Scene {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Put(Put),
    Get(Get),
    List(List),
    Delete(Delete),
}

/// Create scenes from files, or replace those of their names. Sessions that are in one go on in the
/// new one.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe object put examples/objects/*.toml
  troupe scene put examples/scenes/courtyard.toml")]
struct Put {
    /// Scenes in TOML or JSON.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
}

/// Show a scene: its objects, their places and their users.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe scene get courtyard
  troupe scene get courtyard --json | jq .colliders")]
struct Get {
    /// The scene.
    name: String,

    /// Print JSON, colliders included.
    #[arg(long)]
    json: bool,
}

/// List the scenes of the server.
#[derive(Debug, Args)]
struct List {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Delete scenes in which there are no sessions.
#[derive(Debug, Args)]
struct Delete {
    /// The scenes.
    #[arg(required = true, value_name = "NAME")]
    names: Vec<String>,
}

pub(super) async fn run(context: &Context, command: &Scene) -> Result<(), Failure> {
    match &command.action {
        Action::Put(command) => put(context, command).await,
        Action::Get(command) => get(context, command).await,
        Action::List(command) => list(context, command).await,
        Action::Delete(command) => delete(context, command).await,
    }
}

async fn put(context: &Context, command: &Put) -> Result<(), Failure> {
    let client = context.connect().await?;
    for file in &command.files {
        let put = client.put_scene_document(read_document(file)?).await;
        let scene = put.map_err(|error| document_failure(file, error))?;
        context.term.note(format_args!(
            "scene `{}`: {} colliders, {} objects, {} sessions in it",
            scene.name, scene.colliders, scene.objects, scene.sessions
        ));
    }
    Ok(())
}

async fn get(context: &Context, command: &Get) -> Result<(), Failure> {
    let client = context.connect().await?;
    let scene = client.scene(&command.name, Convention::Native).await?;
    if command.json {
        return print(&to_json(&scene)?);
    }
    print(&describe(&scene))
}

async fn list(context: &Context, command: &List) -> Result<(), Failure> {
    let scenes = context.connect().await?.scenes().await?;
    if command.json {
        return print(&to_json(&scenes)?);
    }
    print(&table_of_scenes(&scenes).to_string())
}

async fn delete(context: &Context, command: &Delete) -> Result<(), Failure> {
    let client = context.connect().await?;
    for name in &command.names {
        client.delete_scene(name).await?;
        context.term.note(format_args!("scene `{name}` deleted"));
    }
    Ok(())
}

fn table_of_scenes(scenes: &[v1::SceneSummary]) -> Table {
    let mut table = table();
    table.set_header(["scene", "colliders", "objects", "sessions"]);
    for scene in scenes {
        table.add_row([
            Cell::new(&scene.name),
            Cell::new(scene.colliders),
            Cell::new(scene.objects),
            Cell::new(scene.sessions),
        ]);
    }
    table
}

/// A scene in words and a table of its objects.
fn describe(scene: &v1::Scene) -> String {
    let mut table = table();
    table.set_header(["object", "definition", "place m", "state"]);
    for object in &scene.objects {
        let place = object.position.unwrap_or_default();
        let state = match object.state() {
            v1::ObjectState::Free => "free".to_owned(),
            v1::ObjectState::Reserved => format!("reserved by {}", object.holder),
            v1::ObjectState::Held => format!("held by {}", object.holder),
        };
        table.add_row([
            Cell::new(&object.id),
            Cell::new(&object.definition),
            Cell::new(format!("{:.2} {:.2} {:.2}", place.x, place.y, place.z)),
            Cell::new(state),
        ]);
    }
    format!(
        "{}: ground at {:.2} m, {} colliders, {} sessions in it\n{table}",
        scene.name,
        scene.ground,
        scene.colliders.len(),
        scene.sessions
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_tells_whose_its_objects_are() {
        let object = |id: &str, state: v1::ObjectState, holder: &str| v1::SceneObject {
            id: id.to_owned(),
            definition: "cup".to_owned(),
            state: state.into(),
            holder: holder.to_owned(),
            ..v1::SceneObject::default()
        };
        let scene = v1::Scene {
            name: "yard".to_owned(),
            ground: 0.5,
            objects: vec![
                object("one", v1::ObjectState::Free, ""),
                object("two", v1::ObjectState::Held, "guard"),
            ],
            sessions: 3,
            ..v1::Scene::default()
        };
        let text = describe(&scene);
        assert!(
            text.starts_with("yard: ground at 0.50 m, 0 colliders, 3 sessions in it"),
            "{text}"
        );
        let line = |id: &str| text.lines().find(|line| line.contains(id)).unwrap();
        assert!(
            line("one").contains("free") && line("two").contains("held by guard"),
            "{text}"
        );
    }
}
