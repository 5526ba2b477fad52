//! Which server gets a client's calls about sessions, where several servers share them
//! (docs/cluster.md). Each such call has headers by which a router decides.

use std::hash::{BuildHasher as _, Hasher as _, RandomState};
use std::sync::{Arc, PoisonError, RwLock};

use tonic::metadata::{Ascii, MetadataMap, MetadataValue};

use crate::error::{ClientError, RequestError};
use crate::problem::{Problem, ProblemKind};

/// The header with the scene that a call is about.
const SCENE: &str = "troupe-scene";
/// The header with the server that another server named.
pub(crate) const SERVER: &str = "troupe-server";
/// Most servers that a call is sent to after the first: one that says that the session has moved,
/// one that knows its server, and that one.
pub(crate) const MOVES: usize = 2;

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
            Self::Scene(_) => SCENE,
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

    /// The way of a call about a scene, which may be on another server than the client's sessions.
    /// It is the client's own if the client is routed by this scene, or if no scene is named.
    pub(crate) fn to_scene(&self, scene: &str) -> Self {
        let (header, key) = &self.key;
        let is_own = *header == SCENE && key.to_str().is_ok_and(|key| key == scene);
        if scene.is_empty() || is_own {
            return self.clone();
        }
        // Any server refuses a name that no header can have.
        Self::new(&Route::Scene(scene.to_owned())).unwrap_or_else(|_| self.clone())
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
    fn a_call_about_a_scene_goes_to_its_server_and_the_sessions_stay_where_they_are() {
        let way = Way::new(&Route::Session("hero".to_owned())).unwrap();
        way.follow(&problem(ProblemKind::SessionElsewhere, "b:8080"));
        let own = [pair(SERVER, "b:8080"), pair("troupe-session", "hero")];
        let to_yard = way.to_scene("yard");
        assert_eq!(headers(&to_yard), [pair("troupe-scene", "yard")]);
        assert!(to_yard.follow(&problem(ProblemKind::SessionElsewhere, "c:8080")));
        let yard = [pair("troupe-scene", "yard"), pair(SERVER, "c:8080")];
        assert_eq!(headers(&to_yard), yard);
        assert_eq!(headers(&way), own);
        assert_eq!(headers(&way.to_scene("")), own);
        assert_eq!(headers(&way.to_scene("two words")), own);
        // All calls of a client that is routed by the scene go the same way.
        assert_eq!(headers(&to_yard.to_scene("yard")), yard);
        assert_eq!(headers(&to_yard.to_scene("moor")), [pair("troupe-scene", "moor")]);
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
