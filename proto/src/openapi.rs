//! OpenAPI schemas of the messages as JSON, made from the compiled descriptors. The comments of the
//! `.proto` files become descriptions.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::LazyLock;

use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type as Wire};
use prost_types::{
    DescriptorProto, EnumDescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet,
};
use serde_json::{Value, json};
use utoipa::openapi::schema::AdditionalProperties;
use utoipa::openapi::{ArrayBuilder, KnownFormat, ObjectBuilder, Ref, RefOr, Schema, SchemaFormat, Type};
use utoipa::{PartialSchema, ToSchema};

use crate::v1::{self, FILE_DESCRIPTOR_SET};

include!(concat!(env!("OUT_DIR"), "/messages.rs"));
#[cfg(test)]
pub(crate) use each_message;

/// Field numbers of descriptor.proto, of which the paths to comments are made.
const MESSAGES: i32 = 4;
const ENUMS: i32 = 5;
const FIELDS: i32 = 2;

/// Schemas of all messages and enumerations by name.
pub(crate) static SCHEMAS: LazyLock<BTreeMap<String, Named>> = LazyLock::new(all);

pub(crate) struct Named {
    pub(crate) schema: RefOr<Schema>,
    /// Names of the messages and enumerations in its fields.
    parts: Vec<String>,
}

/// Adds the schemas of all messages and enumerations in the fields of `name`, and deeper.
fn add_parts(name: &str, schemas: &mut Vec<(String, RefOr<Schema>)>) {
    for part in SCHEMAS.get(name).into_iter().flat_map(|named| &named.parts) {
        let known = schemas.iter().any(|(known, _)| known == part);
        if let Some(named) = SCHEMAS.get(part).filter(|_| !known) {
            schemas.push((part.clone(), named.schema.clone()));
            add_parts(part, schemas);
        }
    }
}

macro_rules! schemas {
    ($($message:ident,)*) => {$(
        impl PartialSchema for v1::$message {
            fn schema() -> RefOr<Schema> {
                let named = SCHEMAS.get(stringify!($message));
                named.map_or_else(|| RefOr::T(Schema::default()), |named| named.schema.clone())
            }
        }

        impl ToSchema for v1::$message {
            fn name() -> Cow<'static, str> {
                Cow::Borrowed(stringify!($message))
            }

            fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
                add_parts(stringify!($message), schemas);
            }
        }
    )*};
}

each_message!(schemas);

fn all() -> BTreeMap<String, Named> {
    // The build has written these bytes; a test reads them.
    let set = FileDescriptorSet::decode(FILE_DESCRIPTOR_SET).unwrap_or_default();
    let mut schemas = BTreeMap::new();
    let values = set.file.iter().flat_map(|file| &file.enum_type);
    let defaults = values.filter_map(|values| Some((values.name(), values.value.first()?.name())));
    let defaults: BTreeMap<&str, &str> = defaults.collect();
    for file in set.file.iter().filter(|file| file.package() == "troupe.v1") {
        let comments = Comments::of(file);
        for (index, message) in (0..).zip(&file.message_type) {
            schemas.insert(
                message.name().to_owned(),
                object(message, &comments, index, &defaults),
            );
        }
        for (index, values) in (0..).zip(&file.enum_type) {
            schemas.insert(values.name().to_owned(), words(values, &comments, index));
        }
    }
    schemas
}

/// The comments of a file, by the path to the commented item.
struct Comments<'a>(BTreeMap<&'a [i32], &'a str>);

impl<'a> Comments<'a> {
    fn of(file: &'a FileDescriptorProto) -> Self {
        let places = file.source_code_info.iter().flat_map(|info| &info.location);
        Self(
            places
                .map(|place| (place.path.as_slice(), place.leading_comments()))
                .collect(),
        )
    }

    /// The comment in one line.
    fn at(&self, path: &[i32]) -> Option<String> {
        let lines = self.0.get(path)?.lines().map(str::trim);
        Some(lines.collect::<Vec<_>>().join(" ").trim().to_owned())
    }
}

/// The schema of a message, the `index`th of its file. `defaults` has the default of each
/// enumeration.
fn object(
    message: &DescriptorProto,
    comments: &Comments<'_>,
    index: i32,
    defaults: &BTreeMap<&str, &str>,
) -> Named {
    let mut object = ObjectBuilder::new()
        .schema_type(Type::Object)
        .description(comments.at(&[MESSAGES, index]));
    if REQUESTS.contains(&message.name()) {
        object = object.additional_properties(Some(AdditionalProperties::FreeForm(false)));
    }
    let mut parts = Vec::new();
    for (number, field) in (0..).zip(&message.field) {
        let mut description = comments.at(&[MESSAGES, index, FIELDS, number]);
        if let Some(choice) = choice(message, field) {
            description =
                description.map(|text| format!("At most one field of `{choice}` is present. {text}"));
        }
        object = object.property(field.name(), property(field, description, defaults));
        parts.extend(part(field).map(str::to_owned));
    }
    Named {
        schema: object.into(),
        parts,
    }
}

/// The name of the choice that a field belongs to.
fn choice<'a>(message: &'a DescriptorProto, field: &FieldDescriptorProto) -> Option<&'a str> {
    let index = field.oneof_index.filter(|_| !field.proto3_optional())?;
    let choice = message.oneof_decl.get(usize::try_from(index).ok()?)?;
    Some(choice.name())
}

/// The message or enumeration that a field has.
fn part(field: &FieldDescriptorProto) -> Option<&str> {
    field.type_name.as_ref()?.rsplit('.').next()
}

fn property(
    field: &FieldDescriptorProto,
    description: Option<String>,
    defaults: &BTreeMap<&str, &str>,
) -> RefOr<Schema> {
    if field.label() == Label::Repeated {
        let array = ArrayBuilder::new().items(value(field, None, None));
        return array.description(description).default(Some(json!([]))).into();
    }
    // A field with presence is left out if it is not set; all others are always written.
    let has_presence = field.oneof_index.is_some() || field.r#type() == Wire::Message;
    let default = (!has_presence).then(|| default(field, defaults));
    value(field, description, default)
}

/// A value of the field's type, or of an entry if the field is a list.
fn value(field: &FieldDescriptorProto, description: Option<String>, default: Option<Value>) -> RefOr<Schema> {
    if let Some(name) = part(field) {
        let mut schema = Ref::from_schema_name(name);
        schema.description = description.unwrap_or_default();
        schema.default = default;
        return RefOr::Ref(schema);
    }
    let (kind, format) = match field.r#type() {
        Wire::Bool => (Type::Boolean, None),
        Wire::Float => (Type::Number, Some(known(KnownFormat::Float))),
        Wire::Int32 => (Type::Integer, Some(known(KnownFormat::Int32))),
        Wire::Uint32 => (Type::Integer, Some(custom("uint32"))),
        Wire::Uint64 => (Type::String, Some(custom("uint64"))),
        Wire::Bytes => (Type::String, Some(known(KnownFormat::Byte))),
        _ => (Type::String, None),
    };
    let schema = ObjectBuilder::new().schema_type(kind).format(format);
    schema.description(description).default(default).into()
}

/// The default value of a field without presence.
fn default(field: &FieldDescriptorProto, defaults: &BTreeMap<&str, &str>) -> Value {
    match field.r#type() {
        Wire::Enum => part(field).and_then(|name| defaults.get(name).copied()).into(),
        Wire::Bool => false.into(),
        Wire::Float => 0.0.into(),
        Wire::Int32 | Wire::Uint32 => 0.into(),
        Wire::Uint64 => "0".into(),
        _ => "".into(),
    }
}

fn known(format: KnownFormat) -> SchemaFormat {
    SchemaFormat::KnownFormat(format)
}

fn custom(format: &str) -> SchemaFormat {
    SchemaFormat::Custom(format.to_owned())
}

/// The words of an enumeration.
fn words(values: &EnumDescriptorProto, comments: &Comments<'_>, index: i32) -> Named {
    let names = values.value.iter().map(|value| value.name().to_owned());
    let schema = ObjectBuilder::new()
        .schema_type(Type::String)
        .description(comments.at(&[ENUMS, index]))
        .enum_values(Some(names));
    Named {
        schema: schema.into(),
        parts: Vec::new(),
    }
}
