//! Errors of the protocol: a closed list of codes, each with an HTTP status.

use serde_json::{Map, Value};
use troupe_character::FieldError;

/// A code of the protocol. The list is closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Code {
    /// The request does not have the form that the protocol asks for.
    SchemaValidation,
    /// No model has this id.
    UnknownModel,
    /// The skeleton is not the model's own, and its motion cannot be carried over.
    RetargetingUnsupported,
    /// The model takes no constraint of this type.
    UnsupportedConstraint,
    /// The model takes no segment of this type.
    UnsupportedSegment,
    /// A constraint names a joint that the skeleton does not have.
    UnknownJoint,
    /// The joints of the skeleton do not form a tree.
    InvalidSkeleton,
    /// The motion does not have the frame of a constraint.
    FrameOutOfRange,
    /// The model does not take this option, length or number of things.
    InvalidOptions,
    /// Each part is valid, but the parts do not fit together.
    InvalidRequest,
    /// The major version of the protocol is not supported.
    VersionUnsupported,
    /// The key is missing or unknown.
    Unauthorized,
    /// The key's role does not allow the call, or the web page may not call the server.
    Forbidden,
    /// The body is too large.
    PayloadTooLarge,
    /// The caller has too much in transfer.
    RateLimited,
    /// A failure of the server.
    InternalError,
    /// The queue is full.
    ResourceExhausted,
    /// The server is starting, draining or broken.
    ModelUnavailable,
    /// The request was not served in time.
    Timeout,
}

impl Code {
    /// Every code of the protocol.
    pub const ALL: [Self; 19] = [
        Self::SchemaValidation,
        Self::UnknownModel,
        Self::RetargetingUnsupported,
        Self::UnsupportedConstraint,
        Self::UnsupportedSegment,
        Self::UnknownJoint,
        Self::InvalidSkeleton,
        Self::FrameOutOfRange,
        Self::InvalidOptions,
        Self::InvalidRequest,
        Self::VersionUnsupported,
        Self::Unauthorized,
        Self::Forbidden,
        Self::PayloadTooLarge,
        Self::RateLimited,
        Self::InternalError,
        Self::ResourceExhausted,
        Self::ModelUnavailable,
        Self::Timeout,
    ];

    /// The code on the wire.
    pub fn name(self) -> &'static str {
        self.parts().0
    }

    /// The HTTP status of answers with this code.
    pub fn status(self) -> u16 {
        self.parts().1
    }

    fn parts(self) -> (&'static str, u16) {
        match self {
            Self::SchemaValidation => ("schema_validation", 422),
            Self::UnknownModel => ("unknown_model", 400),
            Self::RetargetingUnsupported => ("retargeting_unsupported", 400),
            Self::UnsupportedConstraint => ("unsupported_constraint", 400),
            Self::UnsupportedSegment => ("unsupported_segment", 400),
            Self::UnknownJoint => ("unknown_joint", 400),
            Self::InvalidSkeleton => ("invalid_skeleton", 400),
            Self::FrameOutOfRange => ("frame_out_of_range", 400),
            Self::InvalidOptions => ("invalid_options", 400),
            Self::InvalidRequest => ("invalid_request", 400),
            Self::VersionUnsupported => ("version_unsupported", 400),
            Self::Unauthorized => ("unauthorized", 401),
            Self::Forbidden => ("forbidden", 403),
            Self::PayloadTooLarge => ("payload_too_large", 413),
            Self::RateLimited => ("rate_limited", 429),
            Self::InternalError => ("internal_error", 500),
            Self::ResourceExhausted => ("resource_exhausted", 503),
            Self::ModelUnavailable => ("model_unavailable", 503),
            Self::Timeout => ("timeout", 504),
        }
    }
}

/// Why a request, or one request of a batch, is not accepted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{place}")]
pub struct Fault {
    /// The protocol's code.
    pub code: Code,
    /// The field at fault, what is wrong with it, and what is allowed.
    pub place: FieldError,
    /// Further members that the protocol's reference server also sends, such as the list of models.
    pub details: Map<String, Value>,
}

impl Fault {
    /// An error of a field.
    pub fn new(
        code: Code,
        field: impl Into<String>,
        message: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Self {
        Self {
            code,
            place: FieldError {
                field: field.into(),
                message: message.into(),
                allowed: allowed.into(),
            },
            details: Map::new(),
        }
    }

    /// An error of an option or a length.
    pub fn option(field: impl Into<String>, message: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self::new(Code::InvalidOptions, field, message, allowed)
    }

    /// An error of a value with the wrong form.
    pub fn schema(field: impl Into<String>, message: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self::new(Code::SchemaValidation, field, message, allowed)
    }

    /// Adds a member to the details.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.details.insert(name.to_owned(), value.into());
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_has_its_own_name() {
        let mut names: Vec<&str> = Code::ALL.into_iter().map(Code::name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), Code::ALL.len());
    }

    #[test]
    fn a_fault_names_field_and_range() {
        let fault = Fault::option("options.num_samples", "is 17", "1 to 16").with("most", 16);
        assert_eq!(fault.to_string(), "options.num_samples: is 17; allowed: 1 to 16");
        assert_eq!(fault.details["most"], 16);
    }
}
