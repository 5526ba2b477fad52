//! Which server gets the calls of a group of characters, if there is a router before several
//! servers (docs/cluster.md).

use tonic::Request;
use tonic::metadata::{Ascii, MetadataValue};
use troupe_client::{Client, Route};

use crate::failure::Failure;

/// The header by which a router decides.
const HEADER: &str = "troupe-session";

/// The route of a group. All its sessions and calls are on one server.
#[derive(Debug, Clone)]
pub(super) struct GroupRoute {
    name: String,
    value: MetadataValue<Ascii>,
}

impl GroupRoute {
    /// The route of group number `nth` of a load. The same load has the same routes, so each of its
    /// groups reaches the same server every time.
    pub(super) fn new(seed: u64, nth: u32) -> Result<Self, Failure> {
        let name = format!("loadtest-{seed}-{nth}");
        let value = name
            .parse()
            .map_err(|_| Failure::Input(format!("{name:?} cannot be the value of a header")))?;
        Ok(Self { name, value })
    }

    /// A client whose sessions are on the group's server.
    pub(super) fn client(&self, client: &Client) -> Result<Client, Failure> {
        Ok(client.routed(Route::Session(self.name.clone()))?)
    }

    /// A call about the group.
    pub(super) fn call<T>(&self, message: T) -> Request<T> {
        let mut call = Request::new(message);
        call.metadata_mut().insert(HEADER, self.value.clone());
        call
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_have_routes_of_their_own_which_stay() {
        let header = |seed, nth| {
            let call = GroupRoute::new(seed, nth).unwrap().call(());
            call.metadata().get(HEADER).unwrap().to_str().unwrap().to_owned()
        };
        assert_eq!(header(3, 12), "loadtest-3-12");
        assert_ne!(header(3, 1), header(3, 2));
        assert_ne!(header(3, 1), header(4, 1));
    }
}
