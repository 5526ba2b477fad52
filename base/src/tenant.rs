//! Tenants: callers whose sessions, scenes and styles are apart from those of others.

use std::sync::Arc;

/// Whose sessions, scenes, definitions and added styles are meant: each tenant has its own, and so
/// have all callers without one together.
pub type Tenant = Option<Arc<str>>;

/// What a tenant may be called, for messages.
pub const TENANT_NAMES: &str = "1 to 64 letters, digits, '-', '_' or '.', not '.' first";

/// Whether a tenant may be called that: its name is that of a folder, too.
pub fn names_a_tenant(name: &str) -> bool {
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    (1..=64).contains(&name.len()) && !name.starts_with('.') && name.chars().all(fits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenant_is_called_as_a_folder_may_be() {
        for (name, fits) in [
            ("a", true),
            ("studio-1_b.c", true),
            ("", false),
            (".hidden", false),
            ("..", false),
            ("a/b", false),
            ("ä", false),
        ] {
            assert_eq!(names_a_tenant(name), fits, "{name:?}");
        }
        assert!(names_a_tenant(&"x".repeat(64)) && !names_a_tenant(&"x".repeat(65)));
    }
}
