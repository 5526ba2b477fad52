//! The OpenAPI document of the HTTP interface. Handlers document what is specific to them. This
//! module adds what follows from an operation's path and body.

use utoipa::OpenApi as _;
use utoipa::openapi::path::{Operation, Parameter, ParameterBuilder, ParameterIn, PathItem};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{ContentBuilder, ObjectBuilder, OpenApi, Ref, RefOr, Required, Response, Type};

use super::error::ErrorBody;
use crate::mmcp::Code;

/// Name of the security scheme.
const KEY: &str = "key";

#[derive(utoipa::OpenApi)]
#[openapi(
    info(
        title = "Troupe",
        description = "Live characters and motion in-betweening, for many characters at once. Right-handed, Y up, +Z forward; \
                       metres, seconds, radians; quaternions as w, x, y, z. Sessions may have another convention. The \
                       same messages travel over gRPC as troupe.v1.Motion, troupe.v1.Sessions, troupe.v1.Scenes and troupe.v1.Skeletons on the same port. A \
                       missing field takes its default (0, false or empty); unknown fields are refused.",
    ),
    components(schemas(troupe_proto::v1::DriveRequest, ErrorBody, MmcpError)),
    tags(
        (name = "motion", description = "Single requests: motion between keyframes"),
        (name = "sessions", description = "Live characters"),
        (name = "styles", description = "Ways to move"),
        (name = "scenes", description = "What characters stand on and use"),
        (name = "objects", description = "What characters can do with things"),
        (name = "skeletons", description = "Skeletons of users' own characters"),
        (name = "mmcp", description = "The Motion Model Context Protocol, which tools such as Blender's Proscenium speak"),
        (name = "operations", description = "What operators need"),
    )
)]
struct Frame;

/// Every error of the Motion Model Context Protocol.
#[derive(utoipa::ToSchema)]
#[expect(
    dead_code,
    reason = "only documents the protocol's errors; `ApiError` writes them"
)]
struct MmcpError {
    /// What went wrong.
    error: MmcpErrorDetail,
}

/// What went wrong, as the protocol has it.
#[derive(utoipa::ToSchema)]
#[expect(dead_code, reason = "only for the document")]
struct MmcpErrorDetail {
    /// One of the protocol's closed list of codes.
    code: String,
    /// What went wrong, for people.
    message: String,
    /// The field at fault, what is allowed, and further details.
    #[schema(value_type = Object)]
    details: serde_json::Value,
}

/// Adds the protocol's errors to an operation, by status.
fn add_mmcp_errors(operation: &mut Operation) {
    for code in Code::ALL {
        let status = code.status().to_string();
        let responses = &mut operation.responses.responses;
        let RefOr::T(response) = responses
            .entry(status)
            .or_insert_with(|| RefOr::T(Response::new(String::new())))
        else {
            continue;
        };
        let comma = if response.description.is_empty() { "" } else { ", " };
        response.description += &format!("{comma}{}", code.name());
        let schema = Ref::from_schema_name("MmcpError");
        let content = ContentBuilder::new().schema(Some(schema)).build();
        response
            .content
            .insert("application/json".to_owned(), content.into());
    }
}

/// The document without paths.
pub(super) fn frame() -> OpenApi {
    Frame::openapi()
}

/// Adds what follows from paths and bodies, and how to send a key.
pub(super) fn complete(document: &mut OpenApi) {
    let key = HttpBuilder::new()
        .scheme(HttpAuthScheme::Bearer)
        .description(Some("An API key, where the server asks for one"))
        .build();
    let components = document.components.get_or_insert_default();
    components.add_security_scheme(KEY, SecurityScheme::Http(key));
    // An empty requirement: a server may ask for no key.
    let none = SecurityRequirement::default();
    document.security = Some(vec![none, SecurityRequirement::new(KEY, [""; 0])]);
    for (path, item) in &mut document.paths.paths {
        for operation in operations(item) {
            add_path_parameters(operation, path);
            add_responses(operation);
        }
    }
}

fn operations(item: &mut PathItem) -> impl Iterator<Item = &mut Operation> {
    let PathItem {
        get,
        put,
        post,
        delete,
        ..
    } = item;
    [get, put, post, delete].into_iter().flatten()
}

/// Adds a parameter for each `{name}` of the path, before the query parameters.
fn add_path_parameters(operation: &mut Operation, path: &str) {
    let mut parameters = Vec::new();
    let mut collection = "";
    for segment in path.split('/') {
        match segment.strip_prefix('{').and_then(|rest| rest.strip_suffix('}')) {
            Some(name) => parameters.push(RefOr::T(path_parameter(name, collection))),
            None => collection = segment,
        }
    }
    if !parameters.is_empty() {
        parameters.extend(operation.parameters.take().unwrap_or_default());
        operation.parameters = Some(parameters);
    }
}

/// The parameter that names a member of a collection.
fn path_parameter(name: &str, collection: &str) -> Parameter {
    let member = match collection {
        "objects" => "definition",
        other => other.trim_end_matches('s'),
    };
    let what = if name == "id" { "id" } else { "name" };
    ParameterBuilder::new()
        .name(name)
        .parameter_in(ParameterIn::Path)
        .required(Required::True)
        .description(Some(format!("The {member}'s {what}")))
        .schema(Some(ObjectBuilder::new().schema_type(Type::String)))
        .build()
}

/// Adds the errors that all operations of a kind share, and the form of their bodies.
fn add_responses(operation: &mut Operation) {
    let tagged = |tag: &str| operation.tags.iter().flatten().any(|name| name == tag);
    if tagged("mmcp") {
        return add_mmcp_errors(operation);
    }
    let needs_packs = ["motion", "styles", "scenes", "objects", "skeletons"]
        .into_iter()
        .any(tagged);
    let has_body = operation.request_body.is_some();
    let has_parameters = operation.parameters.is_some();
    let keyed = !tagged("operations");

    let responses = &mut operation.responses.responses;
    let mut add = |status: &str, description: &str| {
        responses
            .entry(status.to_owned())
            .or_insert_with(|| RefOr::T(Response::new(description)));
    };
    if has_body {
        add(
            "400",
            "A value that is not accepted, or a body that is no request",
        );
        add("413", "The body is too large");
        add("415", "The Content-Type is not application/json");
    } else if has_parameters {
        add("400", "A value that is not accepted");
    }
    add(
        "403",
        "Origin or Host is not one that the server allows, or the key's role is too low",
    );
    if keyed {
        add("401", "The key is missing or unknown");
    }
    if needs_packs {
        add("503", "Not ready yet");
    }
    for (status, response) in responses {
        let RefOr::T(response) = response else { continue };
        if status.starts_with(['4', '5']) && response.content.is_empty() {
            let schema = Ref::from_schema_name("ErrorBody");
            let content = ContentBuilder::new().schema(Some(schema)).build();
            response
                .content
                .insert("application/json".to_owned(), content.into());
        }
    }
}
