//! The node of a connection.

use godot::classes::notify::NodeNotification;
use godot::classes::{INode, Node, ProjectSettings};
use godot::prelude::*;
use troupe_client::Rate;

use crate::closing;
use crate::link::{Link, LinkOptions, Status};

/// Group of all servers of a scene: characters that name no server take its first.
pub(super) const GROUP: &str = "troupe_servers";

/// A connection to a Troupe server. Characters of the scene use it together.
#[derive(GodotClass)]
#[class(init, base = Node)]
pub struct TroupeServer {
    /// Address of the server. Addresses with `https://` use TLS.
    #[export]
    #[init(val = "http://127.0.0.1:8080".into())]
    url: GString,
    /// Key of the client, if the server asks for one. Do not save it in a scene that you publish:
    /// set it from a script, such as from `OS.get_environment`.
    #[export]
    key: GString,
    /// File (PEM) with the certificates of the authorities to trust. Empty: those of the system.
    /// It must be on disk, not in the pack of an exported project.
    #[export(global_file = "*.pem,*.crt")]
    ca_file: GString,
    /// File (PEM) with the client's certificate, for a server that asks for one.
    #[export(global_file = "*.pem,*.crt")]
    certificate_file: GString,
    /// File (PEM) with the private key of the client's certificate.
    #[export(global_file = "*.pem,*.key")]
    key_file: GString,
    /// Frames a second that the server sends: 30, 50 or 60.
    #[export(enum = (Hz30 = 30, Hz50 = 50, Hz60 = 60))]
    #[init(val = 60)]
    rate_hz: i32,
    /// Whether the connection opens when the node enters the scene. Else `open` does that.
    #[export]
    #[init(val = true)]
    open_at_start: bool,
    link: Option<Link>,
    /// Counts the connections of this node.
    generation: u64,
    seen: Status,
    base: Base<Node>,
}

#[godot_api]
impl INode for TroupeServer {
    // Notifications reach this class even if a script overrides _ready or _process.
    fn on_notification(&mut self, what: NodeNotification) {
        match what {
            NodeNotification::ENTER_TREE => {
                self.base_mut().add_to_group(GROUP);
                self.base_mut().set_process_internal(true);
            }
            NodeNotification::READY if self.open_at_start => self.open(),
            NodeNotification::INTERNAL_PROCESS => self.watch(),
            NodeNotification::EXIT_TREE => self.close(),
            _ => {}
        }
    }
}

#[godot_api]
impl TroupeServer {
    /// The connection is open.
    #[signal]
    fn opened();

    /// The connection could not be opened, or broke and could not be opened again for 10 seconds.
    /// `open` tries again, and the characters of the scene come back then.
    #[signal]
    fn failed(message: GString);

    /// Opens the connection, and closes one that is open. It does not wait: `opened` or `failed`
    /// follows.
    #[func]
    fn open(&mut self) {
        self.close();
        self.generation += 1;
        self.seen = Status::Opening;
        let options = match self.options() {
            Ok(options) => options,
            Err(message) => return self.fail(&message),
        };
        match Link::open(&options) {
            Ok(link) => self.link = Some(link),
            Err(error) => self.fail(&error.to_string()),
        }
    }

    /// Closes the connection, and its characters on the server.
    #[func]
    fn close(&mut self) {
        if let Some(thread) = self.link.take().and_then(Link::close) {
            closing::add(thread);
        }
    }

    /// Whether the connection is open.
    #[func]
    fn is_open(&self) -> bool {
        self.link
            .as_ref()
            .is_some_and(|link| link.status() == Status::Open)
    }

    fn options(&self) -> Result<LinkOptions, String> {
        let rate = match self.rate_hz {
            30 => Rate::Hz30,
            50 => Rate::Hz50,
            60 => Rate::Hz60,
            other => return Err(format!("rate_hz is {other}, but must be 30, 50 or 60")),
        };
        let settings = ProjectSettings::singleton();
        let file = |path: &GString| match path.is_empty() {
            true => String::new(),
            false => settings.globalize_path(path).to_string(),
        };
        Ok(LinkOptions {
            url: self.url.to_string(),
            key: self.key.to_string(),
            ca_file: file(&self.ca_file),
            certificate_file: file(&self.certificate_file),
            key_file: file(&self.key_file),
            rate,
        })
    }

    fn fail(&mut self, message: &str) {
        self.seen = Status::Failed(message.to_owned());
        self.signals().failed().emit(message);
    }

    /// Reports what became of the connection.
    fn watch(&mut self) {
        let Some(status) = self.link.as_ref().map(Link::status) else {
            return;
        };
        if status == self.seen {
            return;
        }
        self.seen = status.clone();
        match status {
            Status::Opening => {}
            Status::Open => self.signals().opened().emit(),
            Status::Failed(message) => self.fail(&message),
        }
    }

    /// The connection, if there is one, and its number.
    pub(super) fn link(&self) -> (Option<&Link>, u64) {
        (self.link.as_ref(), self.generation)
    }
}
