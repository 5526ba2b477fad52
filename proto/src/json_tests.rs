//! The JSON form of every message: as protobuf maps it, by the judgement of another library, and as
//! the OpenAPI schemas describe it.

use std::collections::{BTreeMap, BTreeSet};

use prost::Message as _;
use prost_reflect::{
    DescriptorPool, DynamicMessage, FieldDescriptor, Kind, MessageDescriptor, SerializeOptions, Value,
};
use serde_json::{Map, Value as Json, json};
use utoipa::PartialSchema as _;

use crate::openapi::{REQUESTS, SCHEMAS, each_message};
use crate::v1;

/// Each choice of every message has fewer alternatives.
const VARIANTS: usize = 16;

/// A message's Rust type.
struct Form {
    name: &'static str,
    /// Decodes protobuf and writes JSON.
    write: fn(&[u8]) -> Json,
    /// Reads JSON and encodes protobuf.
    read: fn(Json) -> Result<Vec<u8>, serde_json::Error>,
    schema: fn() -> Json,
}

macro_rules! forms {
    ($($message:ident,)*) => {
        &[$(Form {
            name: stringify!($message),
            write: |bytes| serde_json::to_value(v1::$message::decode(bytes).unwrap()).unwrap(),
            read: |json| Ok(serde_json::from_value::<v1::$message>(json)?.encode_to_vec()),
            schema: || serde_json::to_value(v1::$message::schema()).unwrap(),
        },)*]
    };
}

const FORMS: &[Form] = each_message!(forms);

impl Form {
    fn descriptor(&self, pool: &DescriptorPool) -> MessageDescriptor {
        pool.get_message_by_name(&format!("troupe.v1.{}", self.name))
            .unwrap()
    }

    fn written(&self, message: &DynamicMessage) -> Json {
        (self.write)(&message.encode_to_vec())
    }

    fn read(&self, pool: &DescriptorPool, json: Json) -> DynamicMessage {
        let shown = json.to_string();
        let bytes = (self.read)(json).unwrap_or_else(|error| panic!("{} {shown}: {error}", self.name));
        DynamicMessage::decode(self.descriptor(pool), bytes.as_slice()).unwrap()
    }
}

fn pool() -> DescriptorPool {
    DescriptorPool::decode(v1::FILE_DESCRIPTOR_SET).unwrap()
}

fn is_alternative(field: &FieldDescriptor) -> bool {
    field
        .containing_oneof()
        .is_some_and(|choice| !choice.is_synthetic())
}

/// A message with a value in every field, and of each choice the alternative `variant`.
fn full(message: &MessageDescriptor, variant: usize, count: &mut u32) -> DynamicMessage {
    let mut made = DynamicMessage::new(message.clone());
    for field in message.fields() {
        let choice = field.containing_oneof().filter(|_| is_alternative(&field));
        let is_chosen = choice.is_none_or(|choice| {
            assert!(choice.fields().len() <= VARIANTS);
            choice.fields().nth(variant % choice.fields().len()).as_ref() == Some(&field)
        });
        if is_chosen {
            let mut value = || value(&field.kind(), variant, count);
            let value = match field.is_list() {
                true => Value::List(vec![value(), value()]),
                false => value(),
            };
            made.set_field(&field, value);
        }
    }
    made
}

fn value(kind: &Kind, variant: usize, count: &mut u32) -> Value {
    *count += 1;
    match kind {
        Kind::Bool => Value::Bool(true),
        Kind::Int32 => Value::I32(-(*count as i32)),
        Kind::Uint32 => Value::U32(*count),
        // Beyond what a double holds.
        Kind::Uint64 => Value::U64(u64::MAX - u64::from(*count)),
        Kind::Float => Value::F32(0.1 * *count as f32),
        Kind::String => Value::String(format!("\"{count}\" é")),
        // These have a + and a / in base64, and end with =.
        Kind::Bytes => Value::Bytes(vec![251, 255, 190, *count as u8].into()),
        Kind::Enum(values) => Value::EnumNumber(values.values().last().unwrap().number()),
        Kind::Message(message) => Value::Message(full(message, variant, count)),
        other => panic!("no message has {other:?} yet"),
    }
}

/// Every message with every alternative of its choices, and empty.
fn samples(pool: &DescriptorPool) -> impl Iterator<Item = (&'static Form, DynamicMessage)> {
    FORMS.iter().flat_map(|form| {
        let message = form.descriptor(pool);
        let empty = DynamicMessage::new(message.clone());
        let full = (0..VARIANTS).map(move |variant| full(&message, variant, &mut 0));
        full.chain([empty]).map(move |sample| (form, sample))
    })
}

/// What another library writes.
fn mapped(message: &DynamicMessage, options: &SerializeOptions) -> Json {
    message
        .serialize_with_options(serde_json::value::Serializer, options)
        .unwrap()
}

#[test]
fn every_message_is_written_as_protobuf_maps_it() {
    let options = SerializeOptions::new()
        .use_proto_field_name(true)
        .skip_default_fields(false);
    for (form, sample) in samples(&pool()) {
        let ours = form.written(&sample);
        assert_eq!(ours, mapped(&sample, &options), "{}", form.name);
    }
}

#[test]
fn every_message_is_read_in_either_spelling() {
    let pool = pool();
    for (form, sample) in samples(&pool) {
        let own = form.written(&sample);
        let camel = mapped(&sample, &SerializeOptions::new());
        let numbers = mapped(
            &sample,
            &SerializeOptions::new()
                .use_enum_numbers(true)
                .stringify_64_bit_integers(false),
        );
        for json in [own, camel, numbers] {
            assert_eq!(form.read(&pool, json), sample, "{}", form.name);
        }
    }
}

#[test]
fn null_is_the_default_of_every_field() {
    let pool = pool();
    for form in FORMS {
        let message = form.descriptor(&pool);
        let empty = DynamicMessage::new(message.clone());
        for field in message.fields() {
            for name in [field.name(), field.json_name()] {
                assert_eq!(
                    form.read(&pool, json!({ name: null })),
                    empty,
                    "{}.{name}",
                    form.name
                );
            }
            if field.is_list() {
                assert!(
                    (form.read)(json!({ field.name(): [null] })).is_err(),
                    "{}",
                    field.full_name()
                );
            }
        }
    }
}

#[test]
fn requests_alone_refuse_unknown_fields() {
    let pool = pool();
    let methods = pool
        .services()
        .flat_map(|service| service.methods().collect::<Vec<_>>());
    let mut left: Vec<MessageDescriptor> = methods.map(|method| method.input()).collect();
    let mut requests = BTreeSet::new();
    while let Some(message) = left.pop() {
        if requests.insert(message.name().to_owned()) {
            let parts = message.fields();
            left.extend(parts.filter_map(|field| field.kind().as_message().cloned()));
        }
    }
    assert_eq!(requests, REQUESTS.iter().map(|&name| name.to_owned()).collect());
    for form in FORMS {
        let read = (form.read)(json!({ "since_version_9": true }));
        match requests.contains(form.name) {
            true => {
                let error = read.unwrap_err().to_string();
                assert!(error.starts_with("unknown field `since_version_9`"), "{error}");
            }
            false => assert_eq!(read.unwrap(), [0; 0], "{}", form.name),
        }
    }
}

#[test]
fn values_of_enumerations_have_a_name_a_number_and_a_word() {
    let pool = pool();
    for form in FORMS {
        for field in form.descriptor(&pool).fields() {
            let Kind::Enum(values) = field.kind() else {
                continue;
            };
            let first = values.get_value(0).unwrap().name().to_owned();
            let prefix = first.rsplit_once('_').unwrap().0;
            for value in values.values() {
                let word = value
                    .name()
                    .strip_prefix(&format!("{prefix}_"))
                    .unwrap()
                    .to_lowercase();
                let expected = Value::EnumNumber(value.number());
                for json in [json!(value.name()), json!(value.number()), json!(word)] {
                    let read = form.read(&pool, json!({ field.name(): json }));
                    assert_eq!(*read.get_field(&field), expected, "{}", field.full_name());
                }
            }
            for wrong in [json!("f16"), json!(100), json!(first.to_lowercase())] {
                let error = (form.read)(json!({ field.name(): wrong }))
                    .unwrap_err()
                    .to_string();
                assert!(error.contains(&first), "{error}");
            }
        }
    }
}

#[test]
fn schemas_describe_what_is_written_and_nothing_else() {
    let pool = pool();
    let schemas = SCHEMAS.iter();
    let schemas = schemas.map(|(name, named)| (name.clone(), serde_json::to_value(&named.schema).unwrap()));
    let schemas: BTreeMap<String, Json> = schemas.collect();
    for form in FORMS {
        let message = form.descriptor(&pool);
        let schema = (form.schema)();
        let mut written = BTreeSet::new();
        for variant in 0..VARIANTS {
            let json = form.written(&full(&message, variant, &mut 0));
            assert_described(form.name, &schema, &json, &schemas);
            written.extend(json.as_object().unwrap().keys().cloned());
        }
        let properties = schema.get("properties").cloned().unwrap_or_else(|| json!({}));
        let properties: &Map<String, Json> = properties.as_object().unwrap();
        assert_eq!(written, properties.keys().cloned().collect(), "{}", form.name);
        // What an empty message has are the defaults, and no other property has one.
        let defaults = properties
            .iter()
            .filter_map(|(name, property)| Some((name.clone(), property.get("default")?.clone())));
        let empty = form.written(&DynamicMessage::new(message));
        assert_eq!(empty, Json::Object(defaults.collect()), "{}", form.name);
        let is_strict = schema.get("additionalProperties") == Some(&json!(false));
        assert_eq!(is_strict, REQUESTS.contains(&form.name), "{}", form.name);
    }
}

/// Asserts that a value is what its schema says.
fn assert_described(at: &str, schema: &Json, value: &Json, schemas: &BTreeMap<String, Json>) {
    if let Some(name) = schema.get("$ref").and_then(Json::as_str) {
        let name = name.rsplit('/').next().unwrap();
        return assert_described(at, &schemas[name], value, schemas);
    }
    let kind = match value {
        Json::Bool(_) => "boolean",
        Json::Number(number) if number.is_f64() => "number",
        Json::Number(_) => "integer",
        Json::String(_) => "string",
        Json::Array(_) => "array",
        Json::Object(_) => "object",
        Json::Null => "null",
    };
    assert_eq!(schema["type"], kind, "{at}");
    if let Some(words) = schema.get("enum") {
        assert!(words.as_array().unwrap().contains(value), "{at}");
    }
    for entry in value.as_array().into_iter().flatten() {
        assert_described(at, &schema["items"], entry, schemas);
    }
    for (name, entry) in value.as_object().into_iter().flatten() {
        assert_described(
            &format!("{at}.{name}"),
            &schema["properties"][name],
            entry,
            schemas,
        );
    }
}
