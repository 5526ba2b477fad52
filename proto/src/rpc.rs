//! The remote procedures, as `troupe/v1/*.proto` has them.

/// A remote procedure.
#[derive(Debug, Clone, Copy)]
pub struct Rpc {
    /// Its name, unique among all services.
    pub name: &'static str,
    /// The lists of messages or texts in its request.
    pub lists: &'static [List],
}

/// A list in a request.
#[derive(Debug, Clone, Copy)]
pub struct List {
    /// Message and field, such as `Character.context`.
    pub field: &'static str,
    /// What it is a list of: a message's name, `string` or `bytes`.
    pub of: &'static str,
    /// The way to it from the request down; the list itself is the last step.
    pub steps: &'static [Step],
}

/// A field on the way to a list.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    /// The field's number.
    pub number: u32,
    /// The field's name.
    pub name: &'static str,
    /// Whether it is a list.
    pub list: bool,
}

/// A message that a remote procedure takes.
pub trait Request {
    /// The procedure's name.
    const RPC: &'static str;
}

/// Over HTTP, `PutStyle` takes the style alone; the path has the rest.
impl Request for crate::v1::Style {
    const RPC: &'static str = "PutStyle";
}

include!(concat!(env!("OUT_DIR"), "/rpcs.rs"));
