//! Tenants: groups of callers with their own sessions, scenes and styles.

use std::sync::Arc;

/// The owner of sessions, scenes, definitions and added styles. Each tenant has its own. Callers
/// without a tenant (`None`) share theirs.
pub type Tenant = Option<Arc<str>>;

/// Allowed names of tenants, for messages.
pub const TENANT_NAMES: &str = "1 to 64 letters, digits, '-', '_' or '.', not '.' first";

/// Whether a tenant may have this name. It is the name of a folder, too.
pub fn names_a_tenant(name: &str) -> bool {
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    (1..=64).contains(&name.len()) && !name.starts_with('.') && name.chars().all(fits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenant_name_is_a_valid_folder_name() {
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
