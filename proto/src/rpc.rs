//! The remote procedures of `troupe/v1/*.proto`.

/// A remote procedure.
#[derive(Debug, Clone, Copy)]
pub struct Rpc {
    /// Unique among all services.
    pub name: &'static str,
    /// The lists of messages, texts or bytes in its request.
    pub lists: &'static [List],
}

/// A list in a request.
#[derive(Debug, Clone, Copy)]
pub struct List {
    /// Message and field, such as `Character.context`.
    pub field: &'static str,
    /// Type of the entries: a message's name, `string` or `bytes`.
    pub of: &'static str,
    /// The fields from the request down to the list, which is the last one.
    pub steps: &'static [Step],
}

/// A field on the way to a list.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    /// Number in the `.proto` file.
    pub number: u32,
    /// Name in the `.proto` file.
    pub name: &'static str,
    /// Whether the field is a list.
    pub list: bool,
}

/// A message that a remote procedure takes.
pub trait Request {
    /// Name of the procedure that takes it.
    const RPC: &'static str;
}

/// Over HTTP, the body of `PutStyle` is only the style. The path has the rest.
impl Request for crate::v1::Style {
    const RPC: &'static str = "PutStyle";
}

include!(concat!(env!("OUT_DIR"), "/rpcs.rs"));
