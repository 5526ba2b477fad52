//! Packs that operators load, unload and swap while a server runs.

use troupe_proto::v1::{LoadPackRequest, PackChange, SwapPackRequest, UnloadPackRequest};

use crate::connection::Client;
use crate::error::ClientError;

/// For servers that ask for keys, the key needs the role admin.
impl Client {
    /// Loads a pack from the server's folder of packs. An empty `version` is for the newest there.
    /// If it is loaded already, this changes nothing.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Refused`] if there is no such pack, no memory for it, or
    /// if it cannot serve.
    pub async fn load_pack(&self, name: &str, version: &str) -> Result<PackChange, ClientError> {
        let request = LoadPackRequest {
            name: name.to_owned(),
            version: version.to_owned(),
        };
        let answer = self.rpc.clone().load_pack(request).await;
        Ok(answer.map_err(|s| self.sort(&s))?.into_inner())
    }

    /// Has new requests find a pack no more. Calls under way and live sessions go on with it. An
    /// empty `version` is for any.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Refused`] if it is the default pack, or if there is no
    /// such pack.
    pub async fn unload_pack(&self, name: &str, version: &str) -> Result<PackChange, ClientError> {
        let request = UnloadPackRequest {
            name: name.to_owned(),
            version: version.to_owned(),
        };
        let answer = self.rpc.clone().unload_pack(request).await;
        Ok(answer.map_err(|s| self.sort(&s))?.into_inner())
    }

    /// Puts another version of a loaded pack in its place. An empty `version` is for the newest in
    /// the server's folder. If this fails, the version before serves on.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::Refused`] as for [`Client::load_pack`], and if the pack
    /// is not loaded.
    pub async fn swap_pack(&self, name: &str, version: &str) -> Result<PackChange, ClientError> {
        let request = SwapPackRequest {
            name: name.to_owned(),
            version: version.to_owned(),
        };
        let answer = self.rpc.clone().swap_pack(request).await;
        Ok(answer.map_err(|s| self.sort(&s))?.into_inner())
    }
}
