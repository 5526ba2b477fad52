//! `troupe object`.

mod new;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use comfy_table::{Cell, Table};
use troupe_proto::v1;

use self::new::New;
use crate::context::Context;
use crate::failure::Failure;
use crate::files::{document_failure, read_document};
use crate::output::{print, table, to_json};

/// Make smart objects (things, and what characters can do with them), put them on the server, check
/// them, and show those that it has.
#[derive(Debug, Args)]
pub(super) struct Object {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    New(Box<New>),
    Put(Put),
    Check(Check),
    Get(Get),
    List(List),
    Delete(Delete),
}

/// Add definitions from files, or replace those of their names. All objects of one get its shape
/// and trigger at once. All files are checked before the first is put.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe object put examples/objects/cup.toml
  troupe object put examples/objects/*.toml")]
struct Put {
    #[command(flatten)]
    files: Files,
}

/// Check definitions in files against the server's pack. Nothing changes.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe object check examples/objects/*.toml")]
struct Check {
    #[command(flatten)]
    files: Files,
}

/// Definitions, and the pack that they are for.
#[derive(Debug, Args)]
struct Files {
    /// Definitions in TOML or JSON.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,

    /// Model pack whose characters use them; without it the server's default.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME")]
    pack: String,
}

/// Print a definition as the server has it.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe object get cup > cup.toml")]
struct Get {
    /// The definition.
    name: String,

    /// Print JSON instead of TOML.
    #[arg(long)]
    json: bool,
}

/// List the definitions of the server.
#[derive(Debug, Args)]
struct List {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Delete definitions of which no scene has an object.
#[derive(Debug, Args)]
struct Delete {
    /// The definitions.
    #[arg(required = true, value_name = "NAME")]
    names: Vec<String>,
}

pub(super) async fn run(context: &Context, command: &Object) -> Result<(), Failure> {
    match &command.action {
        Action::New(command) => new::run(context, command).await,
        Action::Put(command) => upload(context, &command.files, false).await,
        Action::Check(command) => upload(context, &command.files, true).await,
        Action::Get(command) => get(context, command).await,
        Action::List(command) => list(context, command).await,
        Action::Delete(command) => delete(context, command).await,
    }
}

async fn upload(context: &Context, files: &Files, check_only: bool) -> Result<(), Failure> {
    let (client, pack) = context.connect_to_pack(&files.pack).await?;
    let documents: Vec<_> = (files.files.iter())
        .map(|file| Ok((file, read_document(file)?)))
        .collect::<Result<_, Failure>>()?;
    // All or none: a bad file among them is found before the first is put.
    if !check_only && documents.len() > 1 {
        for (file, document) in &documents {
            let checked = client.check_object(&pack, document.clone()).await;
            checked.map_err(|error| document_failure(file, error))?;
        }
    }
    for (file, document) in documents {
        let answer = match check_only {
            true => client.check_object(&pack, document).await,
            false => client.put_object(&pack, document).await,
        };
        let uploaded = answer.map_err(|error| document_failure(file, error))?;
        context
            .term
            .note(format_args!("{}", outcome(&uploaded, pack.name(), check_only)));
    }
    Ok(())
}

fn outcome(uploaded: &v1::PutObjectDefinitionResponse, pack: &str, check_only: bool) -> String {
    let definition = uploaded.definition.clone().unwrap_or_default();
    let parts = format!(
        "{} variants, {} sets, {} sockets",
        definition.variants.len(),
        definition.sets.len(),
        definition.sockets.len()
    );
    let name = definition.name;
    match (check_only, uploaded.replaced) {
        (true, _) => format!("`{name}` is good for pack `{pack}`: {parts}"),
        (false, true) => format!(
            "`{name}` replaced: {parts}; {} objects follow it",
            uploaded.rebound
        ),
        (false, false) => format!("`{name}` added for pack `{pack}`: {parts}"),
    }
}

async fn get(context: &Context, command: &Get) -> Result<(), Failure> {
    let format = match command.json {
        true => v1::DocumentFormat::Json,
        false => v1::DocumentFormat::Toml,
    };
    let answer = context.connect().await?.object(&command.name, format).await?;
    print(answer.document.unwrap_or_default().text.trim_end())
}

async fn list(context: &Context, command: &List) -> Result<(), Failure> {
    let definitions = context.connect().await?.objects().await?;
    if command.json {
        return print(&to_json(&definitions)?);
    }
    print(&table_of_definitions(&definitions).to_string())
}

async fn delete(context: &Context, command: &Delete) -> Result<(), Failure> {
    let client = context.connect().await?;
    for name in &command.names {
        client.delete_object(name).await?;
        context
            .term
            .note(format_args!("object definition `{name}` deleted"));
    }
    Ok(())
}

fn table_of_definitions(definitions: &[v1::ObjectDefinition]) -> Table {
    let mut table = table();
    table.set_header([
        "definition",
        "pack",
        "variants",
        "approaches",
        "objects",
        "what it is",
    ]);
    for definition in definitions {
        let variants: Vec<&str> = definition.variants.iter().map(|v| v.name.as_str()).collect();
        let approaches = match definition.approaches.is_empty() {
            true => "any side".to_owned(),
            false => definition.approaches.join(", "),
        };
        table.add_row([
            Cell::new(&definition.name),
            Cell::new(&definition.pack),
            Cell::new(variants.join(", ")),
            Cell::new(approaches),
            Cell::new(definition.objects),
            Cell::new(&definition.description),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_upload_tells_what_it_did() {
        let uploaded = |replaced| v1::PutObjectDefinitionResponse {
            definition: Some(v1::ObjectDefinition {
                name: "cup".to_owned(),
                sets: vec!["reach".to_owned(), "lift".to_owned()],
                ..v1::ObjectDefinition::default()
            }),
            replaced,
            rebound: 4,
        };
        assert_eq!(
            outcome(&uploaded(false), "human", false),
            "`cup` added for pack `human`: 0 variants, 2 sets, 0 sockets"
        );
        assert!(outcome(&uploaded(true), "human", false).ends_with("4 objects follow it"));
        assert!(outcome(&uploaded(true), "human", true).contains("is good for pack `human`"));
    }
}
