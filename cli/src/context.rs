//! What every command works with: a server, and where notes go.

use troupe_client::{Client, ConnectOptions, Pack};

use crate::failure::Failure;
use crate::term::Term;

/// Which server to ask, how, and where notes go.
pub struct Context {
    /// Address of the server.
    pub(crate) url: String,
    pub(crate) options: ConnectOptions,
    /// Takes notes and progress.
    pub term: Term,
}

impl Context {
    /// Connects to the server.
    ///
    /// # Errors
    /// [`Failure::Client`] if it does not answer, or not to this key.
    pub async fn connect(&self) -> Result<Client, Failure> {
        Ok(Client::connect_with(&self.url, self.options.clone()).await?)
    }

    /// Connects and fetches a pack; an empty name stands for the server's default pack.
    ///
    /// # Errors
    /// [`Failure::Client`] if the server does not answer or has no such pack.
    pub async fn connect_to_pack(&self, name: &str) -> Result<(Client, Pack), Failure> {
        let client = self.connect().await?;
        let pack = client.pack(name).await?;
        Ok((client, pack))
    }

    /// Connects and fetches a pack; an empty name stands for the first that has a capability.
    pub(crate) async fn connect_to_able(
        &self,
        capability: &str,
        name: &str,
    ) -> Result<(Client, Pack), Failure> {
        if !name.is_empty() {
            return self.connect_to_pack(name).await;
        }
        let client = self.connect().await?;
        let able = |pack: &&Pack| {
            let mut all = pack.description().capabilities.iter();
            all.any(|able| able == capability)
        };
        let packs = client.packs().await?;
        let Some(pack) = packs.iter().find(able) else {
            return Err(Failure::Other(format!(
                "the server has no pack with the capability `{capability}`"
            )));
        };
        // The list leaves some of a pack out.
        let pack = client.pack(pack.name()).await?;
        Ok((client, pack))
    }
}
