//! How tokens are sampled.

use troupe_character::{FieldError, Path};
use troupe_engine::pack::MAX_REPETITION;
use troupe_motion::model::SamplingTask;
use troupe_proto::v1;

use troupe_live::wire::{MAX_TEMPERATURE, units};

/// Checks the field `sampling` of the request at `root`. The pack decides fields that are left out.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub(super) fn check_sampling(
    root: &Path<'_>,
    sampling: Option<&v1::Sampling>,
) -> Result<SamplingTask, FieldError> {
    let Some(&v1::Sampling {
        temperature,
        top_k,
        top_p,
        repetition,
    }) = sampling
    else {
        return Ok(SamplingTask::default());
    };
    let path = root.field("sampling");
    if let Some(temperature) = temperature {
        units::within(&path.field("temperature"), temperature, 0.0, MAX_TEMPERATURE)?;
    }
    if let Some(found) = top_p.filter(|&top_p| !(top_p > 0.0 && top_p <= 1.0)) {
        let path = path.field("top_p");
        return Err(path.error(format!("is {found}"), "more than 0, and at most 1"));
    }
    if let Some(repetition) = repetition {
        units::within(&path.field("repetition"), repetition, 1.0, MAX_REPETITION)?;
    }
    Ok(SamplingTask {
        temperature,
        top_k,
        top_p,
        repetition,
    })
}

/// Rejects `sampling` beside a path, whose motion follows from the seed alone.
///
/// # Errors
/// [`FieldError`] if the field is given.
pub fn no_sampling(request: &v1::GenerateRequest) -> Result<(), FieldError> {
    match request.sampling {
        None => Ok(()),
        Some(_) => Err(Path::root()
            .field("sampling")
            .error("is given", "none beside path")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Change = fn(&mut v1::Sampling);

    #[test]
    fn what_is_left_out_is_the_packs() {
        let check = |sampling| check_sampling(&Path::root(), sampling);
        assert_eq!(check(None).unwrap(), SamplingTask::default());
        let some = v1::Sampling {
            temperature: Some(0.0),
            top_k: Some(7),
            ..v1::Sampling::default()
        };
        let task = SamplingTask {
            top_k: Some(7),
            ..SamplingTask::at(0.0)
        };
        assert_eq!(check(Some(&some)).unwrap(), task);
    }

    #[test]
    fn each_number_has_its_range() {
        let cases: [(Change, Option<&str>); 12] = [
            (|s| s.temperature = Some(-0.1), Some("temperature")),
            (|s| s.temperature = Some(2.1), Some("temperature")),
            (|s| s.temperature = Some(f32::NAN), Some("temperature")),
            (|s| s.top_p = Some(0.0), Some("top_p")),
            (|s| s.top_p = Some(1.1), Some("top_p")),
            (|s| s.top_p = Some(f32::NAN), Some("top_p")),
            (|s| s.repetition = Some(0.9), Some("repetition")),
            (|s| s.repetition = Some(10.5), Some("repetition")),
            (|s| s.temperature = Some(2.0), None),
            (|s| s.top_p = Some(1.0), None),
            (|s| s.repetition = Some(10.0), None),
            (|s| s.top_k = Some(u32::MAX), None),
        ];
        for (change, field) in cases {
            let mut sampling = v1::Sampling::default();
            change(&mut sampling);
            let found = check_sampling(&Path::root(), Some(&sampling)).err();
            let found = found.map(|error| error.field);
            assert_eq!(
                found,
                field.map(|field| format!("sampling.{field}")),
                "{sampling:?}"
            );
        }
    }
}
