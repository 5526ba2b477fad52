//! The committed OpenAPI document is the one that the server serves.

#[test]
fn the_committed_document_is_current() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/openapi.json");
    let current = troupe_server::api::document().to_pretty_json().unwrap() + "\n";
    if std::env::var_os("UPDATE_OPENAPI").is_some() {
        std::fs::write(path, &current).unwrap();
    }
    let committed = std::fs::read_to_string(path).unwrap_or_default();
    let line = committed.lines().zip(current.lines()).position(|(a, b)| a != b);
    assert!(
        committed == current,
        "{path} differs from the code (line {line:?}). If the change of the interface is meant, update it with \
         `UPDATE_OPENAPI=1 cargo test -p troupe-server --test wire openapi`",
    );
}

#[test]
fn every_field_of_a_message_is_described() {
    let document: serde_json::Value =
        serde_json::from_str(&troupe_server::api::document().to_json().unwrap()).unwrap();
    let schemas = document["components"]["schemas"].as_object().unwrap();
    assert!(schemas.len() > 60, "{} schemas", schemas.len());
    for (name, schema) in schemas {
        // The alternatives of a choice are messages, and describe themselves.
        let Some(properties) = schema["properties"].as_object() else {
            continue;
        };
        assert!(schema["description"].is_string(), "{name}");
        for (field, value) in properties {
            // An optional message describes itself inside its alternatives.
            let described = value["description"].is_string() || value["oneOf"][0]["description"].is_string();
            assert!(described, "{name}.{field} has no description: {value}");
        }
    }
}
