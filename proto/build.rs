//! Generates the Rust types from `troupe/v1/*.proto`, and the gRPC services where the feature
//! `grpc` is on, without a system `protoc`.
//!
//! What the types need beside (their JSON form, what requests may contain) follows from the
//! descriptors.

use std::collections::BTreeSet;
use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use prost::Message as _;
use protox::prost_reflect::{
    DescriptorPool, EnumDescriptor, FieldDescriptor, Kind, MessageDescriptor, MethodDescriptor,
};

const PACKAGE: &str = "troupe.v1";

/// Lists that were added when the JSON form was in use. Empty ones are left out of the JSON, all
/// others are written.
const LEFT_OUT_WHEN_EMPTY: [&str; 16] = [
    "Keyframe.qpos",
    "Frames.six_d",
    "Frames.qpos",
    "Frames.hinge_residuals",
    "Frames.clamped_hinges",
    "FrameBlock.six_d",
    "FrameBlock.qpos",
    "FrameBlock.hinge_residuals",
    "FrameBlock.clamped_hinges",
    "Style.words",
    "GenerateResponse.notes",
    "Pack.bodies",
    "Pack.words",
    "Prompt.targets",
    "Prompt.others",
    "PackBody.joints",
];

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=troupe");
    let mut compiler = protox::Compiler::new(["."])?;
    compiler.include_imports(true).include_source_info(true);
    compiler.open_files(proto_files(Path::new("troupe/v1"))?)?;
    let (descriptors, pool) = (compiler.file_descriptor_set(), compiler.descriptor_pool());

    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("troupe.v1.bin"), descriptors.encode_to_vec())?;
    std::fs::write(out.join("words.rs"), words(&pool))?;
    std::fs::write(out.join("rpcs.rs"), rpcs(&pool)?)?;

    let services = std::env::var_os("CARGO_FEATURE_GRPC").is_some();
    let mut config = tonic_prost_build::configure()
        .build_client(services)
        .build_server(services)
        .type_attribute(
            ".",
            "#[derive(serde::Serialize, serde::Deserialize, utoipa::ToSchema)]",
        )
        .message_attribute(".", "#[serde(default)]");
    for message in request_messages(&pool) {
        config = config.type_attribute(format!(".{message}"), "#[serde(deny_unknown_fields)]");
    }
    for message in pool.all_messages() {
        for oneof in message.oneofs().filter(|oneof| !oneof.is_synthetic()) {
            let schema = format!("{}{}", message.name(), camel(oneof.name()));
            let attribute = format!(r#"#[serde(rename_all = "snake_case")] #[schema(as = {schema})]"#);
            config = config.type_attribute(format!(".{}", oneof.full_name()), attribute);
        }
        for field in message.fields() {
            if let Some(attribute) = field_attribute(&field)? {
                config = config.field_attribute(format!(".{}", field.full_name()), attribute);
            }
        }
    }
    for field in LEFT_OUT_WHEN_EMPTY {
        if !is_list(&pool, field) {
            return Err(format!("LEFT_OUT_WHEN_EMPTY names {field}, which is no list").into());
        }
        let attribute = r#"#[serde(skip_serializing_if = "Vec::is_empty")]"#;
        config = config.field_attribute(format!(".{PACKAGE}.{field}"), attribute);
    }
    config.compile_fds(descriptors)?;
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

fn is_list(pool: &DescriptorPool, field: &str) -> bool {
    field
        .split_once('.')
        .and_then(|(message, field)| {
            pool.get_message_by_name(&format!("{PACKAGE}.{message}"))?
                .get_field_by_name(field)
        })
        .is_some_and(|field| field.is_list())
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

/// How a field is written in JSON, where that is not serde's own way.
fn field_attribute(field: &FieldDescriptor) -> Result<Option<String>, String> {
    let in_oneof = field
        .containing_oneof()
        .is_some_and(|oneof| !oneof.is_synthetic());
    let optional = field.supports_presence() && !in_oneof;
    Ok(match field.kind() {
        Kind::Enum(_) | Kind::Bytes if optional || in_oneof || field.is_list() => {
            let name = field.full_name();
            return Err(format!("{name}: the JSON form knows plain enumerations and bytes only"));
        }
        Kind::Enum(values) => {
            let (module, default) = (snake(values.name()), word(&values, values.default_value().name()));
            Some(format!(
                r#"#[serde(with = "crate::json::{module}")] #[schema(value_type = String, default = "{default}")]"#
            ))
        }
        Kind::Bytes => Some(
            r#"#[serde(with = "crate::json::base64")] #[schema(value_type = String, format = Byte, default = "")]"#
                .to_owned(),
        ),
        _ if optional => Some(r#"#[serde(skip_serializing_if = "Option::is_none")]"#.to_owned()),
        _ => None,
    })
}

/// The modules of `src/json.rs` that write enumerations as words.
fn words(pool: &DescriptorPool) -> String {
    pool.all_enums().fold(String::new(), |mut text, values| {
        let (module, name, prefix) = (snake(values.name()), values.name(), prefix(&values));
        let _ = writeln!(text, "words!({module}, crate::v1::{name}, \"{prefix}\");");
        text
    })
}

/// What the names of an enumeration's values begin with: `ACTIVITY_KIND_` for `ActivityKind`.
fn prefix(values: &EnumDescriptor) -> String {
    snake(values.name()).to_ascii_uppercase() + "_"
}

fn word(values: &EnumDescriptor, name: &str) -> String {
    let prefix = prefix(values);
    name.strip_prefix(&prefix).unwrap_or(name).to_ascii_lowercase()
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
            "impl Request for crate::v1::{} {{ const RPC: &'static str = {name:?}; }}",
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

/// `Intent` for `intent`.
fn camel(name: &str) -> String {
    let parts = name.split('_').map(|part| {
        let (first, rest) = part.split_at(part.len().min(1));
        first.to_ascii_uppercase() + rest
    });
    parts.collect()
}
