//! The locomotion styles of a pack.

use troupe_proto::v1;

use crate::connection::Client;
use crate::error::ClientError;
use crate::pack::Pack;

impl Client {
    /// The styles of a pack, sorted by name and without their keyframes, and the name of the
    /// default.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn styles(&self, pack: &Pack) -> Result<v1::ListStylesResponse, ClientError> {
        let request = v1::ListStylesRequest {
            pack: pack.name().to_owned(),
            body: pack.body().to_owned(),
        };
        self.unary(|mut rpc| async move { rpc.list_styles(request).await })
            .await
    }

    /// One style with its keyframes.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn style(&self, pack: &Pack, name: &str) -> Result<v1::Style, ClientError> {
        let request = v1::GetStyleRequest {
            pack: pack.name().to_owned(),
            style: name.to_owned(),
            body: pack.body().to_owned(),
        };
        self.unary(|mut rpc| async move { rpc.get_style(request).await })
            .await
    }

    /// Adds a style to a pack, or replaces an added one, and returns it as the server keeps it.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn put_style(&self, pack: &Pack, style: v1::Style) -> Result<v1::Style, ClientError> {
        let request = v1::PutStyleRequest {
            pack: pack.name().to_owned(),
            style: Some(style),
            body: pack.body().to_owned(),
        };
        self.unary(|mut rpc| async move { rpc.put_style(request).await })
            .await
    }
}
