//! Tests of whole files.

mod archives;
mod dialects;
#[cfg(feature = "fbx")]
mod fbx;
mod followers;
mod headers;
mod hostile;
mod kinds;
mod neutral;
mod onto;
pub(crate) mod people;
mod rigs;
mod robots;
mod roots;
mod shared;
mod trackers;

use super::{OptionName, ReadError};

/// The options of an error are those that its text names.
fn names_its_options(error: &ReadError) {
    let text = error.to_string();
    let options = error.options();
    for option in OptionName::all().chain([OptionName::Skeleton]) {
        let is_named = text.contains(option.flag());
        let decides = options.iter().any(|choice| choice.option == option);
        assert_eq!(is_named, decides, "{option:?}: {text}");
    }
}
