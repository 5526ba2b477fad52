//! A server in this process. It has no networks, and no client uses its socket.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};
use std::time::Duration;

use axum::Router;
use tokio::net::TcpListener;
use tokio::runtime::{Builder, Runtime};
use troupe_character::testing::toy_rig;
use troupe_engine::generator::Generator;
use troupe_engine::pack::Pack;
use troupe_engine::pack::testing::pack_of;
use troupe_engine::toy::{FAMILY, Toy};
use troupe_motion::model::Capabilities;
use troupe_proto::v1;
use troupe_server::api::testing::Reader;
use troupe_server::config::Config;
use troupe_server::server::testing::serve_here;
use troupe_server::server::{PackSource, ServerHandle};
use troupe_service::Service;

/// The object definition that every target starts with.
pub const STOOL: &str = include_str!("../corpus/object/toy-stool.toml");
/// The scene that every target starts with: two objects of [`STOOL`].
pub const YARD: &str = include_str!("../corpus/scene/toy-yard.toml");
/// The most sessions on a page of a list.
const PAGE: u32 = 1000;

/// A running server with the pack `toy`, the scene `yard` and two sessions: `a` is in the scene,
/// `b` in none.
pub struct Local {
    runtime: Runtime,
    handle: ServerHandle,
    /// The same routes that a connection to the server uses.
    pub router: Router,
    /// Decodes messages with the limits of the server.
    pub reader: Reader,
}

thread_local! {
    static LOCAL: OnceCell<Local> = const { OnceCell::new() };
}

/// A pack of two joints. Its generator serves all kinds of calls and needs no networks.
fn source() -> PackSource {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../server/tests/common/toy");
    let mut manifest = pack_of(toy_rig()).manifest;
    manifest.family = FAMILY.to_owned();
    manifest.capabilities = Capabilities {
        inbetween: true,
        live: true,
        text: true,
        describe: true,
        ..Capabilities::default()
    };
    PackSource {
        pack: Pack::from_manifest(manifest, &folder).expect("a pack"),
        workers: 1,
        generator: Box::new(|pack, max_batch| {
            Ok(Box::new(Toy::new(pack.rig.dims, max_batch)) as Box<dyn Generator>)
        }),
        decision: None,
    }
}

/// Options of a session, with defaults for all but its id and its scene (empty for none).
pub fn options(id: &str, scene: &str) -> v1::SessionOptions {
    v1::SessionOptions {
        id: id.to_owned(),
        scene: scene.to_owned(),
        seed: 7,
        ..v1::SessionOptions::default()
    }
}

impl Local {
    /// A server that keeps sessions, scenes and definitions in the folder `store`, if it has one.
    pub fn start(store: Option<PathBuf>) -> Self {
        let runtime = Builder::new_current_thread()
            .enable_all()
            .build()
            .expect("a runtime");
        let mut config = Config::local(Path::new("unused")).expect("a configuration");
        config.default_pack = Some("toy".to_owned());
        config.fixed.worker_spin = Duration::ZERO;
        config.store = store;
        config.fixed.snapshot_interval = Duration::from_millis(60_000);
        let (handle, router) = runtime.block_on(async {
            let listener = TcpListener::bind(config.listen).await.expect("a port");
            let served = serve_here(config.clone(), listener, || Ok(vec![source()])).await;
            let mut handle = served.expect("a server");
            handle.ready().await.expect("a pack");
            let router = handle.routes(&config).expect("routes");
            (handle, router)
        });
        let local = Self {
            runtime,
            handle,
            router,
            reader: Reader::new(&config.api_limits()),
        };
        local.run(local.furnish());
        local
    }

    /// Runs `work` with the server of this thread, and starts that server if need be.
    pub fn with<T>(work: impl FnOnce(&Self) -> T) -> T {
        LOCAL.with(|local| work(local.get_or_init(|| Self::start(None))))
    }

    /// The service behind the routes.
    pub fn service(&self) -> &Service {
        self.handle.service()
    }

    /// Blocks this thread until `work` has ended.
    pub fn run<T>(&self, work: impl Future<Output = T>) -> T {
        self.runtime.block_on(work)
    }

    /// Stops the server. Its store is complete afterwards.
    pub fn stop(self) {
        self.runtime.block_on(self.handle.shut_down());
    }

    async fn furnish(&self) {
        let service = self.service();
        let document = |text: &str| {
            Some(v1::Document {
                format: v1::DocumentFormat::Toml.into(),
                text: text.to_owned(),
            })
        };
        let stool = v1::PutObjectDefinitionRequest {
            document: document(STOOL),
            ..v1::PutObjectDefinitionRequest::default()
        };
        service.put_object_definition(stool).await.expect("a definition");
        let yard = v1::PutSceneRequest {
            document: document(YARD),
            ..v1::PutSceneRequest::default()
        };
        service.put_scene(yard).await.expect("a scene");
        self.open_sessions().await;
    }

    async fn open_sessions(&self) {
        let request = v1::CreateSessionsRequest {
            sessions: vec![options("a", "yard"), options("b", "")],
        };
        self.service().create_sessions(request).await.expect("sessions");
    }

    /// Brings the two sessions back to their state at the start.
    pub async fn reset_sessions(&self) {
        let open = self.sessions();
        if let [a, b] = open.as_slice()
            && (a.id.as_str(), b.id.as_str()) == ("a", "b")
            && open.iter().all(untouched)
        {
            return;
        }
        self.close_sessions();
        self.open_sessions().await;
    }

    /// The open sessions, in the order of their ids.
    fn sessions(&self) -> Vec<v1::Session> {
        let list = v1::ListSessionsRequest {
            page_size: PAGE,
            page_token: String::new(),
        };
        self.service().sessions().list(&list).expect("a page").sessions
    }

    fn close_sessions(&self) {
        loop {
            let ids: Vec<_> = self.sessions().into_iter().map(|session| session.id).collect();
            if ids.is_empty() {
                return;
            }
            let request = v1::CloseSessionsRequest { ids };
            self.service().sessions().close(&request).expect("sessions");
        }
    }

    /// Brings sessions, scenes and definitions back to their state at the start. Styles stay,
    /// because no call removes them.
    pub async fn reset(&self) {
        let service = self.service();
        self.close_sessions();
        for scene in service.list_scenes().expect("scenes").scenes {
            let name = scene.name;
            service
                .delete_scene(v1::DeleteSceneRequest { name })
                .await
                .expect("a scene");
        }
        let definitions = service.list_object_definitions().await.expect("definitions");
        for definition in definitions.definitions {
            let request = v1::DeleteObjectDefinitionRequest {
                name: definition.name,
            };
            service
                .delete_object_definition(request)
                .await
                .expect("a definition");
        }
        self.furnish().await;
    }
}

/// Whether no call has moved or commanded the session since its start.
fn untouched(session: &v1::Session) -> bool {
    let usual = v1::Session {
        frame: 0,
        last_sequence: 0,
        priority: 0.5,
        ..session.clone()
    };
    *session == usual && session.clock == i32::from(v1::Clock::Free)
}
