//! Generates the Rust types from `troupe/v1/*.proto` without a system `protoc`. With the feature
//! `grpc` it generates the gRPC services too.
//!
//! The JSON form of the types and the tables of requests are generated from the descriptors.

use std::collections::BTreeSet;
use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use prost::Message as _;
use prost_types::FileDescriptorSet;
use protox::prost_reflect::{DescriptorPool, FieldDescriptor, Kind, MessageDescriptor, MethodDescriptor};

const PACKAGE: &str = "troupe.v1";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=troupe");
    let mut compiler = protox::Compiler::new(["."])?;
    compiler.include_imports(true).include_source_info(true);
    compiler.open_files(proto_files(Path::new("troupe/v1"))?)?;
    let (descriptors, pool) = (compiler.file_descriptor_set(), compiler.descriptor_pool());

    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("troupe.v1.bin"), descriptors.encode_to_vec())?;
    std::fs::write(out.join("json.rs"), json(&descriptors, &pool)?)?;
    std::fs::write(out.join("messages.rs"), messages(&pool))?;
    std::fs::write(out.join("rpcs.rs"), rpcs(&pool)?)?;

    let services = std::env::var_os("CARGO_FEATURE_GRPC").is_some();
    tonic_prost_build::configure()
        .build_client(services)
        .build_server(services)
        .compile_fds(descriptors)?;
    Ok(())
}

/// The `.proto` files of a folder, by name.
fn proto_files(folder: &Path) -> Result<BTreeSet<PathBuf>, std::io::Error> {
    let mut files = BTreeSet::new();
    for entry in std::fs::read_dir(folder)? {
        let file = entry?.path();
        if file.extension().is_some_and(|extension| extension == "proto") {
            files.insert(file);
        }
    }
    Ok(files)
}

fn methods(pool: &DescriptorPool) -> Vec<MethodDescriptor> {
    let services = pool.services();
    services
        .flat_map(|service| service.methods().collect::<Vec<_>>())
        .collect()
}

/// Full names of the messages that a client sends. An unknown JSON field there is a mistake worth
/// reporting; in answers it must be tolerated, so that an older client can read a newer server.
fn request_messages(pool: &DescriptorPool) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut left: Vec<MessageDescriptor> = methods(pool).iter().map(MethodDescriptor::input).collect();
    while let Some(message) = left.pop() {
        if found.insert(message.full_name().to_owned()) {
            left.extend(message.fields().filter_map(|field| match field.kind() {
                Kind::Message(message) => Some(message),
                _ => None,
            }));
        }
    }
    found
}

/// The JSON form of every message and enumeration: pbjson's, with what [`adapted`] changes.
fn json(descriptors: &FileDescriptorSet, pool: &DescriptorPool) -> Result<String, Box<dyn Error>> {
    let mut builder = pbjson_build::Builder::new();
    for file in &descriptors.file {
        builder.register_file_descriptor(file.clone());
    }
    // Every field has its name from the .proto file, and is written unless it has presence.
    builder.preserve_proto_field_names().emit_fields();
    let requests: Vec<String> = request_messages(pool)
        .iter()
        .map(|name| format!(".{name}"))
        .collect();
    let mut written = builder.generate(&requests, |_| Ok(Vec::new()))?;
    builder.ignore_unknown_fields().exclude(requests);
    written.extend(builder.generate(&[format!(".{PACKAGE}")], |_| Ok(Vec::new()))?);
    let bytes = written.into_iter().flat_map(|(_, text)| text).collect();
    adapted(String::from_utf8(bytes)?, pool)
}

/// pbjson's code with these differences, which docs/decisions/json.md explains:
/// - `null` is the default of every field.
/// - Numbers in lists are read fast, and a wrong one gets an error with the reason.
/// - Enumerations are read from short words too: `walk` for `GAIT_WALK`.
/// - Errors give fields the names that they have in answers, and list each once.
fn adapted(code: String, pool: &DescriptorPool) -> Result<String, Box<dyn Error>> {
    let mut changes = vec![
        (
            "map_.next_value".to_owned(),
            "map_.next_value_or_default".to_owned(),
        ),
        ("::pbjson::private".to_owned(), "crate::json".to_owned()),
        ("pbjson::private".to_owned(), "crate::json".to_owned()),
        (
            "\"expected one of: {:?}\"".to_owned(),
            "\"one of {:?}\"".to_owned(),
        ),
    ];
    for values in pool.all_enums() {
        let prefix = snake(values.name()).to_ascii_uppercase() + "_";
        for value in values.values() {
            let name = value.name();
            let word = name.strip_prefix(&prefix).unwrap_or(name).to_ascii_lowercase();
            changes.push((format!("\"{name}\" => "), format!("\"{name}\" | \"{word}\" => ")));
        }
    }
    let mut code = code;
    for (from, to) in changes {
        if !code.contains(&from) {
            return Err(format!(
                "pbjson's code has no {from:?}: it has changed, look at docs/decisions/json.md"
            )
            .into());
        }
        code = code.replace(&from, &to);
    }
    let lines = code.lines().filter(|line| !is_camel_entry(line));
    let lines = lines.map(|line| match line.split_once("duplicate_field(") {
        Some((before, name)) => format!("{before}duplicate_field({}\n", snake(name)),
        None => format!("{line}\n"),
    });
    Ok(lines.collect())
}

/// Whether a line is a camel case name in a list of fields, such as `"frameCount",`.
fn is_camel_entry(line: &str) -> bool {
    let name = line
        .trim()
        .strip_prefix('"')
        .and_then(|rest| rest.strip_suffix("\","));
    name.is_some_and(|name| {
        let has = |kind: fn(&char) -> bool| name.chars().any(|c| kind(&c));
        has(char::is_ascii_uppercase) && has(char::is_ascii_lowercase)
    })
}

/// A macro that passes the names of all messages to another macro, and the names of those that
/// refuse unknown fields.
fn messages(pool: &DescriptorPool) -> String {
    let names: String = pool
        .all_messages()
        .filter(|message| message.package_name() == PACKAGE)
        .map(|message| format!("{}, ", message.name()))
        .collect();
    let requests: String = request_messages(pool)
        .iter()
        .map(|name| format!("{:?}, ", name.trim_start_matches(PACKAGE).trim_start_matches('.')))
        .collect();
    format!(
        "macro_rules! each_message {{ ($do:ident) => {{ $do! {{ {names} }} }} }}\n\
         pub(crate) const REQUESTS: &[&str] = &[{requests}];\n"
    )
}

/// The tables of `src/rpc.rs`: every remote procedure with the lists of its request, and the
/// procedure of every request.
fn rpcs(pool: &DescriptorPool) -> Result<String, String> {
    let mut table = String::from("/// Every remote procedure.\npub const RPCS: &[Rpc] = &[\n");
    let mut requests = String::new();
    for method in methods(pool) {
        let (name, input) = (method.name(), method.input());
        let mut lists = String::new();
        find_lists(&input, &mut Vec::new(), &mut lists)?;
        let _ = writeln!(table, "Rpc {{ name: {name:?}, lists: &[{lists}] }},");
        let _ = writeln!(
            requests,
            "impl Request for crate::v1::{} {{ const RPC: &'static str = {name:?}; \
             fn from_json(json: &[u8]) -> Result<Self, JsonError> {{ read_json(json) }} }}",
            input.name()
        );
    }
    Ok(format!("{table}];\n{requests}"))
}

/// Writes every list of messages or texts in `message`, and deeper. Numbers are not counted: they
/// take as much on the wire as in memory.
fn find_lists(
    message: &MessageDescriptor,
    way: &mut Vec<FieldDescriptor>,
    lists: &mut String,
) -> Result<(), String> {
    for field in message.fields() {
        let deeper = field.kind().as_message().cloned();
        let known = way.iter().any(|step| step.parent_message() == message);
        if known || field.is_map() {
            return Err(format!(
                "{}: no request may hold itself or a map",
                field.full_name()
            ));
        }
        way.push(field.clone());
        let of = match field.kind() {
            Kind::Message(message) => Some(message.name().to_owned()),
            Kind::String => Some("string".to_owned()),
            Kind::Bytes => Some("bytes".to_owned()),
            _ => None,
        };
        if let Some(of) = of.filter(|_| field.is_list()) {
            let name = format!("{}.{}", message.name(), field.name());
            let steps = way.iter().fold(String::new(), |mut text, step| {
                let (number, name, list) = (step.number(), step.name(), step.is_list());
                let _ = write!(text, "Step {{ number: {number}, name: {name:?}, list: {list} }},");
                text
            });
            let _ = write!(
                lists,
                "List {{ field: {name:?}, of: {of:?}, steps: &[{steps}] }},"
            );
        }
        if let Some(deeper) = deeper {
            find_lists(&deeper, way, lists)?;
        }
        way.pop();
    }
    Ok(())
}

/// `activity_kind` for `ActivityKind`.
fn snake(name: &str) -> String {
    let mut text = String::new();
    for c in name.chars() {
        if c.is_ascii_uppercase() && !text.is_empty() {
            text.push('_');
        }
        text.push(c.to_ascii_lowercase());
    }
    text
}
