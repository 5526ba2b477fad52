//! Which server gets a client's calls about sessions, where several servers share them
//! (docs/cluster.md). Each such call has headers by which a router decides.

use std::hash::{BuildHasher as _, Hasher as _, RandomState};
use std::sync::{Arc, PoisonError, RwLock};

use tonic::metadata::{Ascii, MetadataMap, MetadataValue};

use crate::error::{ClientError, RequestError};
use crate::problem::{Problem, ProblemKind};

/// The header with the server that another server named.
pub(crate) const SERVER: &str = "troupe-server";

/// What a client's calls about sessions are routed by. All sessions of a client are on one server,
/// because they share steps and streams.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Route {
    /// A name, such as the id of the client's only session. Calls by HTTP for a session of this id
    /// then reach the same server.
    Session(String),
    /// The scene of the client's sessions. All sessions in a scene must be routed by it.
    Scene(String),
}

impl Route {
    /// A name that no other client has.
    pub(crate) fn of_one_client() -> Self {
        let number = RandomState::new().build_hasher().finish();
        Self::Session(format!("client-{number:016x}"))
    }

    fn header(&self) -> &'static str {
        match self {
            Self::Session(_) => "troupe-session",
            Self::Scene(_) => "troupe-scene",
        }
    }

    fn name(&self) -> &str {
        let (Self::Session(name) | Self::Scene(name)) = self;
        name
    }
}

/// The route of a client and its clones.
#[derive(Debug, Clone)]
pub(crate) struct Way {
    key: (&'static str, MetadataValue<Ascii>),
    /// The server that has the sessions, if another one said so.
    server: Arc<RwLock<Option<MetadataValue<Ascii>>>>,
}

impl Way {
    /// The way of a client, by its own name if it has no route.
    ///
    /// # Errors
    /// [`RequestError::Route`].
    pub(crate) fn of(route: Option<&Route>) -> Result<Self, ClientError> {
        match route {
            Some(route) => Self::new(route),
            None => Self::new(&Route::of_one_client()),
        }
    }

    /// # Errors
    /// [`RequestError::Route`].
    fn new(route: &Route) -> Result<Self, ClientError> {
        let fault = || RequestError::Route {
            name: route.name().to_owned(),
        };
        let name = route.name();
        let is_name = !name.is_empty() && name.chars().all(|c| c.is_ascii_graphic());
        let value = name
            .parse::<MetadataValue<Ascii>>()
            .ok()
            .filter(|_| is_name)
            .ok_or_else(fault)?;
        Ok(Self {
            key: (route.header(), value),
            server: Arc::default(),
        })
    }

    /// Puts the headers on a call.
    pub(crate) fn mark(&self, call: &mut MetadataMap) {
        let (header, key) = &self.key;
        call.insert(*header, key.clone());
        let server = self.server.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(server) = &*server {
            call.insert(SERVER, server.clone());
        }
    }

    /// From now on, calls go to the server that this problem names. Returns whether that is
    /// another one than before, so that the call may be repeated.
    pub(crate) fn follow(&self, problem: &Problem) -> bool {
        let owner: Option<MetadataValue<Ascii>> = match problem.kind {
            ProblemKind::SessionElsewhere => problem.allowed.as_deref().and_then(|owner| owner.parse().ok()),
            // Any server knows which one has it.
            ProblemKind::SessionMoved => None,
            _ => return false,
        };
        let mut server = self.server.write().unwrap_or_else(PoisonError::into_inner);
        let is_new = *server != owner || owner.is_none();
        *server = owner;
        is_new
    }

    /// The server is lost: the router decides again.
    pub(crate) fn forget(&self) {
        *self.server.write().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(way: &Way) -> Vec<(String, String)> {
        let mut call = MetadataMap::new();
        way.mark(&mut call);
        let headers = call.into_headers();
        let text = |value: &http::HeaderValue| value.to_str().unwrap().to_owned();
        let mut all: Vec<_> = headers.iter().map(|(k, v)| (k.to_string(), text(v))).collect();
        all.sort();
        all
    }

    fn pair(key: &str, value: &str) -> (String, String) {
        (key.to_owned(), value.to_owned())
    }

    fn problem(kind: ProblemKind, owner: &str) -> Problem {
        Problem {
            kind,
            message: String::new(),
            field: None,
            allowed: Some(owner.to_owned()),
        }
    }

    #[test]
    fn calls_follow_the_server_that_a_problem_names_until_it_is_lost() {
        let way = Way::new(&Route::Scene("yard".to_owned())).unwrap();
        assert_eq!(headers(&way), [pair("troupe-scene", "yard")]);
        let elsewhere = problem(ProblemKind::SessionElsewhere, "b:8080");
        assert!(way.follow(&elsewhere) && !way.follow(&elsewhere));
        let both = [pair("troupe-scene", "yard"), pair(SERVER, "b:8080")];
        assert_eq!(headers(&way), both);
        assert!(!way.follow(&problem(ProblemKind::SessionBusy, "c:8080")));
        assert_eq!(headers(&way), both);
        assert!(way.follow(&problem(ProblemKind::SessionMoved, "")));
        assert_eq!(headers(&way), [pair("troupe-scene", "yard")]);
        way.follow(&elsewhere);
        way.forget();
        assert_eq!(headers(&way), [pair("troupe-scene", "yard")]);
    }

    #[test]
    fn clients_have_names_of_their_own() {
        let (one, two) = (Route::of_one_client(), Route::of_one_client());
        assert_ne!(one, two);
        let way = Way::new(&one).unwrap();
        assert_eq!(headers(&way), [pair("troupe-session", one.name())]);
    }

    #[test]
    fn a_name_that_no_header_can_have_is_an_error() {
        for name in ["", "two words", "a\nb", "Höhle"] {
            let error = Way::new(&Route::Session(name.to_owned())).unwrap_err();
            assert!(error.to_string().contains("route"), "{error}");
        }
    }
}
