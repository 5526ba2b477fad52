//! Opens a character: its pack, its skeleton, its session.

use std::sync::Arc;

use thiserror::Error;
use tokio::sync::Mutex;
use tonic::Code;
use troupe_client::{Client, ClientError, Pack, Session};

use super::actor::{Actor, Wanted};

/// Why a character cannot be opened.
#[derive(Debug, Error)]
pub(super) enum OpeningError {
    /// The server's skeleton of this name is another one.
    #[error("the server has other joints under the name `{0}`: delete that skeleton")]
    OtherJoints(String),
    /// The client's error.
    #[error(transparent)]
    Client(#[from] ClientError),
}

/// A character that was opened, or why not.
pub(super) struct Opened {
    pub(super) actor: Arc<Actor>,
    pub(super) session: Result<Session, OpeningError>,
}

/// Opens characters of a connection. Skeletons go up one after the other, so that a crowd on one
/// skeleton sends it once.
pub(super) struct Openings {
    client: Client,
    upload: Mutex<()>,
}

impl Openings {
    pub(super) fn new(client: Client) -> Self {
        Self {
            client,
            upload: Mutex::new(()),
        }
    }

    pub(super) async fn open(&self, actor: Arc<Actor>) -> Opened {
        let session = self.session(&actor.wanted).await;
        Opened { actor, session }
    }

    async fn session(&self, wanted: &Wanted) -> Result<Session, OpeningError> {
        let pack = self.pack(wanted).await?;
        Ok(self.client.session(&pack, &wanted.session).await?)
    }

    /// The pack, whose characters wear the character's skeleton.
    async fn pack(&self, wanted: &Wanted) -> Result<Pack, OpeningError> {
        let mut pack = self.client.pack(&wanted.pack).await?;
        // The list of packs, from which the default comes, has no bodies' joints.
        if wanted.pack.is_empty() && !pack.description().bodies.is_empty() {
            pack = self.client.pack(pack.name()).await?;
        }
        let pack = pack.of_body(&wanted.body)?;
        let (name, joints) = (wanted.rig.name(), wanted.rig.joints());
        let one = self.upload.lock().await;
        // A key may be too weak for an upload, but good enough for a skeleton that is there.
        let own = match self.client.skeleton(name, &pack).await {
            Err(ClientError::Refused(refusal)) if refusal.code == Code::NotFound => {
                self.client.put_joints(name, joints.clone(), &pack, false).await?
            }
            there => there?,
        };
        drop(one);
        let names = own.joints.iter().map(|joint| &joint.name);
        if !names.eq(joints.joints.iter().map(|joint| &joint.name)) {
            return Err(OpeningError::OtherJoints(name.to_owned()));
        }
        Ok(pack.wearing(&own).map_err(ClientError::from)?)
    }
}
