//! Serves a call. The samples of all its requests are made together.

use std::sync::Arc;
use std::time::Instant;

use serde::Deserialize;
use serde_json::Value;
use troupe_character::FieldError;
use troupe_character::post::NonFinite;
use troupe_character::take::{Made, Making};
use troupe_motion::model::{Output, Task};
use troupe_proto::rpc::{self, JsonError, read_json};

use super::answer;
use super::asked::Asked;
use super::check::check;
use super::fault::{Code, Fault};
use super::limits::MAX_BATCH;
use super::model::models;
use super::schema::check_version;
use troupe_base::offload::{WorkerStopped, offload};
use troupe_base::telemetry::RequestContext;
use troupe_batch::trace_served;
use troupe_live::packs::LoadedPack;
use troupe_live::session::Space;
use troupe_service::{Service, ServiceError};

/// Most samples whose planning stays on the calling thread.
const INLINE_SAMPLES: usize = 2;

/// The body of a call: a request, or a batch of requests. It is decoded when its model is known.
#[derive(Debug, Clone, Deserialize)]
#[serde(transparent)]
pub struct RequestOrBatch(pub Value);

impl rpc::Request for RequestOrBatch {
    const RPC: &'static str = "MmcpGenerate";

    fn from_json(json: &[u8]) -> Result<Self, JsonError> {
        read_json(json)
    }
}

/// Why a request was not served.
#[derive(Debug, Clone, thiserror::Error)]
pub enum Failure {
    /// The request is not accepted.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The request was accepted, but not served.
    #[error(transparent)]
    Service(Box<ServiceError>),
}

impl From<ServiceError> for Failure {
    fn from(error: ServiceError) -> Self {
        Self::Service(Box::new(error))
    }
}

impl From<NonFinite> for Failure {
    fn from(error: NonFinite) -> Self {
        ServiceError::from(error).into()
    }
}

impl From<WorkerStopped> for Failure {
    fn from(error: WorkerStopped) -> Self {
        ServiceError::from(error).into()
    }
}

/// The answer to a call.
#[derive(Debug)]
pub enum Reply {
    /// The document of a single request.
    One(Vec<u8>),
    /// The documents of a batch, in the order of its requests.
    Many(Vec<Result<Vec<u8>, Failure>>),
}

/// Serves a request or a batch.
///
/// # Errors
/// [`Failure`] for a single request that is not served, and for a malformed batch.
pub async fn generate(service: &Service, body: RequestOrBatch) -> Result<Reply, Failure> {
    let arrived = Instant::now();
    let most = service.max_characters();
    let space = service.space()?.clone();
    let RequestOrBatch(value) = body;
    let is_batch = value.get("requests").is_some();
    // A skeleton of the caller's own takes milliseconds.
    let takes = offload(usize::MAX, 0, move || read(value, &space, most)).await??;
    let mut made = serve(service, takes, arrived).await;
    match (is_batch, made.pop()) {
        (false, Some(document)) => document.map(Reply::One),
        (true, Some(last)) => {
            made.push(last);
            Ok(Reply::Many(made))
        }
        (_, None) => Err(WorkerStopped.into()),
    }
}

/// Checks a request, or each request of a batch.
fn read(value: Value, space: &Space, most: usize) -> Result<Vec<Result<Asked, Failure>>, Fault> {
    let models = models(&space.packs.table());
    if value.get("requests").is_none() {
        let take = check(value, &models, space)?;
        if take.samples > most {
            let found = format!("is {}", take.samples);
            return Err(Fault::option(
                "options.num_samples",
                found,
                format!("1 to {most}"),
            ));
        }
        return Ok(vec![Ok(take)]);
    }
    let takes: Vec<Result<Asked, Failure>> = batch(value)?
        .into_iter()
        .map(|item| check(item?, &models, space).map_err(Failure::from))
        .collect();
    let samples: usize = takes.iter().flatten().map(|take| take.samples).sum();
    if samples > most {
        let found = format!("have {samples} samples in all");
        return Err(Fault::option("requests", found, format!("at most {most}")));
    }
    Ok(takes)
}

/// The requests of a batch. A request without a version gets the batch's version.
fn batch(mut value: Value) -> Result<Vec<Result<Value, Fault>>, Fault> {
    let version = value
        .get("protocol_version")
        .and_then(Value::as_str)
        .map(str::to_owned);
    let Some(version) = version else {
        let allowed = "MAJOR.MINOR, such as 1.4";
        return Err(Fault::schema(
            "protocol_version",
            "is missing, or no text",
            allowed,
        ));
    };
    check_version(&version)?;
    let items = match value.get_mut("requests").map(Value::take) {
        Some(Value::Array(items)) if !items.is_empty() => items,
        _ => {
            let allowed = format!("1 to {MAX_BATCH} requests");
            return Err(Fault::schema("requests", "is no list, or empty", allowed));
        }
    };
    if items.len() > MAX_BATCH {
        let found = format!("has {} entries", items.len());
        let fault = Fault::option("requests", found, format!("at most {MAX_BATCH}"));
        return Err(fault
            .with("max_batch_size", MAX_BATCH)
            .with("requests", items.len()));
    }
    let each = items.into_iter().enumerate();
    let each = each.map(|(index, mut item)| match item.as_object_mut() {
        Some(object) => {
            let version = || Value::String(version.clone());
            object.entry("protocol_version").or_insert_with(version);
            Ok(item)
        }
        None => {
            let field = format!("requests[{index}]");
            Err(Fault::schema(field, "is no object", "a request"))
        }
    });
    Ok(each.collect())
}

/// One sample in progress.
struct Job {
    /// Index of the request.
    take: usize,
    making: Making,
    /// The error that stopped this sample.
    failure: Option<Failure>,
}

/// Maps the error of a path that the model does not take to the request's field.
fn not_a_path(error: &FieldError) -> Fault {
    Fault::new(
        Code::InvalidOptions,
        "constraints",
        format!(
            "make a path that the model does not take: {}: {}",
            error.field, error.message
        ),
        error.allowed.clone(),
    )
}

/// The documents of all takes, in their order.
async fn serve(
    service: &Service,
    takes: Vec<Result<Asked, Failure>>,
    arrived: Instant,
) -> Vec<Result<Vec<u8>, Failure>> {
    let mut packs: Vec<Arc<LoadedPack>> = Vec::new();
    for take in takes.iter().flatten() {
        let loaded = &take.by;
        if !packs.iter().any(|other| Arc::ptr_eq(other, loaded)) {
            packs.push(loaded.clone());
        }
    }
    let takes = Arc::new(takes);
    let groups = packs.iter().map(|loaded| group(service, loaded, &takes, arrived));
    let groups = futures_util::future::join_all(groups).await;
    let mut answers: Vec<Option<Result<Vec<u8>, Failure>>> = takes
        .iter()
        .map(|take| take.as_ref().err().map(|failure| Err(failure.clone())))
        .collect();
    for (take, answer) in groups.into_iter().flatten() {
        answers[take] = Some(answer);
    }
    let stopped = || Err(WorkerStopped.into());
    answers
        .into_iter()
        .map(|answer| answer.unwrap_or_else(stopped))
        .collect()
}

/// The documents of all takes of one pack, each with its index.
async fn group(
    service: &Service,
    loaded: &Arc<LoadedPack>,
    takes: &Arc<Vec<Result<Asked, Failure>>>,
    arrived: Instant,
) -> Vec<(usize, Result<Vec<u8>, Failure>)> {
    let of_pack = |take: &Asked| Arc::ptr_eq(&take.by, loaded);
    let own: Vec<usize> = (0..takes.len())
        .filter(|&index| takes[index].as_ref().is_ok_and(of_pack))
        .collect();
    let samples = own
        .iter()
        .map(|&index| takes[index].as_ref().map_or(0, |take| take.samples));
    let samples: usize = samples.sum();
    let made = make(service, loaded, takes, &own, (samples, arrived)).await;
    let jobs = match made {
        Ok(jobs) => jobs,
        Err(failure) => {
            return own
                .into_iter()
                .map(|index| (index, Err(failure.clone())))
                .collect();
        }
    };
    let begun = Instant::now();
    let (shared, places) = (takes.clone(), own.clone());
    let written = offload(samples, 0, move || documents(&shared, &places, jobs)).await;
    RequestContext::part("finish", begun, Vec::new);
    match written {
        Ok(written) => own.into_iter().zip(written).collect(),
        Err(error) => own.into_iter().map(|index| (index, Err(error.into()))).collect(),
    }
}

/// Makes all samples together, one window of each at a time. Windows that wait together form a
/// batch.
async fn make(
    service: &Service,
    loaded: &LoadedPack,
    takes: &Arc<Vec<Result<Asked, Failure>>>,
    own: &[usize],
    (samples, arrived): (usize, Instant),
) -> Result<Vec<Job>, Failure> {
    if let Some(error) = loaded.batcher.refuse(&service.order(arrived), samples) {
        return Err(ServiceError::from(error).into());
    }
    let (shared, own) = (takes.clone(), own.to_vec());
    let begun = offload(samples, INLINE_SAMPLES, move || begin(&shared, &own)).await;
    let (mut jobs, mut tasks) = begun?;
    while !tasks.is_empty() {
        let (places, batch): (Vec<usize>, Vec<Task>) = tasks.into_iter().unzip();
        let asked = Instant::now();
        let served = loaded.batcher.submit(batch, service.order(arrived)).await;
        let served = served.map_err(ServiceError::from)?;
        if let Some(trace) = RequestContext::current_trace() {
            trace_served(&trace, asked, &served);
        }
        let answers: Vec<(usize, Output)> = places.into_iter().zip(served.outputs).collect();
        let shared = takes.clone();
        let stepped = offload(samples, INLINE_SAMPLES, move || {
            for (place, made) in answers {
                let job: &mut Job = &mut jobs[place];
                let made = fitted(made, &shared[job.take]);
                job.failure = job.making.receive(&made).err().map(Failure::from);
            }
            let tasks = step(&mut jobs);
            (jobs, tasks)
        });
        (jobs, tasks) = stepped.await?;
    }
    Ok(jobs)
}

/// The output of a generator. Words are cut to what fits into a prompt of the model.
fn fitted(made: Output, asked: &Result<Asked, Failure>) -> Output {
    match (made, asked) {
        (Output::Text(text), Ok(asked)) => Output::Text(asked.model.fitting(&text)),
        (made, _) => made,
    }
}

fn begin(takes: &[Result<Asked, Failure>], own: &[usize]) -> (Vec<Job>, Vec<(usize, Task)>) {
    let mut jobs = Vec::new();
    for &index in own {
        let Ok(take) = &takes[index] else { continue };
        for sample in 0..take.samples {
            jobs.push(Job {
                take: index,
                making: Making::new(&take.take, sample),
                failure: None,
            });
        }
    }
    let tasks = step(&mut jobs);
    (jobs, tasks)
}

/// The next window of each unfinished job.
fn step(jobs: &mut [Job]) -> Vec<(usize, Task)> {
    let mut tasks = Vec::new();
    for (place, job) in jobs.iter_mut().enumerate() {
        if job.failure.is_some() {
            continue;
        }
        match job.making.next_task() {
            Ok(task) => tasks.extend(task.map(|task| (place, task))),
            Err(error) => job.failure = Some(not_a_path(&error).into()),
        }
    }
    tasks
}

/// Finishes all jobs, and writes the document of each take.
fn documents(
    takes: &[Result<Asked, Failure>],
    own: &[usize],
    jobs: Vec<Job>,
) -> Vec<Result<Vec<u8>, Failure>> {
    let mut samples: Vec<Result<Vec<Made>, Failure>> = takes.iter().map(|_| Ok(Vec::new())).collect();
    for Job {
        take,
        making,
        failure,
    } in jobs
    {
        let made = match failure {
            Some(failure) => Err(failure),
            None => making.finish().map_err(Failure::from),
        };
        match (&mut samples[take], made) {
            (Ok(samples), Ok(made)) => samples.push(made),
            (all @ Ok(_), Err(failure)) => *all = Err(failure),
            (Err(_), _) => {}
        }
    }
    let document = |&index: &usize| {
        let take = takes[index].as_ref().map_err(Failure::clone)?;
        let made = std::mem::replace(&mut samples[index], Ok(Vec::new()))?;
        answer::write(take, &made).map_err(|error| {
            tracing::error!(%error, "a document is not written");
            WorkerStopped.into()
        })
    };
    own.iter().map(document).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_batch_is_a_list_of_requests_of_a_version() {
        let items = batch(json!({"protocol_version": "1.4", "requests": [{"model": "a"}, 3]})).unwrap();
        assert_eq!(items[0].as_ref().unwrap()["protocol_version"], "1.4");
        assert_eq!(items[1].as_ref().unwrap_err().place.field, "requests[1]");
        let code = |value| batch(value).unwrap_err().code;
        assert_eq!(code(json!({"requests": []})), Code::SchemaValidation);
        assert_eq!(
            code(json!({"protocol_version": "2.0", "requests": [{}]})),
            Code::VersionUnsupported
        );
        assert_eq!(
            code(json!({"protocol_version": "1.0", "requests": {}})),
            Code::SchemaValidation
        );
        let many = json!({"protocol_version": "1.0", "requests": vec![json!({}); MAX_BATCH + 1]});
        assert_eq!(code(many), Code::InvalidOptions);
    }
}
