//! The server as attackers see it, and what they share with the server's own tests.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use tokio::net::{TcpSocket, TcpStream};
use tonic::transport::{Channel, Endpoint};
use troupe_proto::v1::sessions_client::SessionsClient;

#[path = "../../../../server/tests/common/attacks.rs"]
pub mod attacks;
#[path = "../../../../server/tests/common/calls.rs"]
pub mod calls;
#[path = "../../../../server/tests/common/scenes.rs"]
pub mod scenes;

/// The server, and the address from which an attacker calls. The victim has another address, as in
/// a network.
#[derive(Debug, Clone, Copy)]
pub struct TestServer {
    address: SocketAddr,
    from: Ipv4Addr,
}

impl TestServer {
    /// The server for attacker number `nth`, whose address is 127.0.0.2 + `nth`. Linux needs no
    /// setup for these addresses.
    pub fn new(address: SocketAddr, nth: u8) -> Self {
        let from = Ipv4Addr::new(127, 0, 0, 2 + nth);
        Self { address, from }
    }

    /// The same server for attacker number `nth`.
    pub fn by(&self, nth: u8) -> Self {
        Self::new(self.address, nth)
    }

    pub fn endpoint(&self) -> Endpoint {
        let endpoint = Channel::from_shared(format!("http://{}", self.address)).unwrap();
        endpoint.local_address(Some(IpAddr::V4(self.from)))
    }

    pub async fn channel(&self) -> Channel {
        self.endpoint().connect().await.unwrap()
    }

    pub async fn sessions(&self) -> SessionsClient<Channel> {
        SessionsClient::new(self.channel().await).max_decoding_message_size(usize::MAX)
    }

    pub async fn try_tcp(&self) -> std::io::Result<TcpStream> {
        let socket = TcpSocket::new_v4()?;
        socket.bind(SocketAddr::new(IpAddr::V4(self.from), 0))?;
        socket.connect(self.address).await
    }

    pub async fn tcp(&self) -> TcpStream {
        self.try_tcp().await.unwrap()
    }
}
