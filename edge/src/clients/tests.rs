use super::*;

fn clients() -> Clients {
    let share = |bytes, streams, sessions| Share {
        bytes,
        streams,
        sessions,
    };
    let shares = Shares {
        client: share(10 << 10, 2, 1000),
        address: share(15 << 10, 3, 1500),
        all: share(20 << 10, 4, usize::MAX),
    };
    Clients::new(shares, &Telemetry::new().unwrap())
}

fn address(last: u8) -> IpAddr {
    IpAddr::from([10, 0, 0, last])
}

#[test]
fn each_level_has_a_limit_and_gets_back_what_is_dropped() {
    let clients = clients();
    let (a, b, c) = (
        clients.connected(address(1)),
        clients.connected(address(1)),
        clients.connected(address(2)),
    );
    let first = a.memory(8 << 10).unwrap();
    let error = a.memory(4 << 10).unwrap_err();
    assert!(
        error.to_string().starts_with("this client has no memory"),
        "{error}"
    );
    assert!(!error.never && a.memory(11 << 10).unwrap_err().never);
    let second = b.memory(7 << 10).unwrap();
    let error = b.memory(1 << 10).unwrap_err();
    assert!(error.to_string().starts_with("this address"), "{error}");
    let third = c.memory(5 << 10).unwrap();
    let error = c.memory(1 << 10).unwrap_err();
    assert!(error.to_string().starts_with("all clients together"), "{error}");
    drop((first, second, third));
    assert!(a.memory(10 << 10).is_ok());
}

#[test]
fn memory_grows_by_pieces_and_a_refusal_changes_nothing() {
    let clients = clients();
    let client = clients.connected(address(1));
    let mut memory = client.memory(1).unwrap();
    memory.grow(1023).unwrap();
    memory.grow(9 << 10).unwrap();
    memory.grow(1).unwrap_err();
    assert_eq!(memory.bytes(), 10 << 10);
    drop(memory);
    assert!(client.memory(10 << 10).is_ok());
}

#[test]
fn a_key_has_one_share_on_all_its_connections() {
    let clients = clients();
    let connections: Vec<_> = (1..4).map(|last| clients.connected(address(last))).collect();
    let one = clients.with_key("one", Quota::default(), None, &connections[0]);
    let again = clients.with_key("one", Quota::default(), None, &connections[1]);
    let other = clients.with_key("other", Quota::default(), None, &connections[2]);
    let _held = one.memory(6 << 10).unwrap();
    let error = again.memory(6 << 10).unwrap_err();
    assert!(error.to_string().starts_with("this key"), "{error}");
    assert!(other.memory(6 << 10).is_ok());
    // What the key has does not count for the connection beside it.
    assert!(connections[0].memory(9 << 10).is_ok());
}

#[test]
fn streams_of_one_client_leave_room_for_others() {
    let clients = clients();
    let client = clients.connected(address(1));
    let held: Vec<_> = (0..2).map(|_| client.stream().unwrap()).collect();
    assert!(client.stream().is_err());
    assert!(clients.connected(address(1)).stream().is_ok());
    assert!(clients.connected(address(2)).stream().is_ok());
    drop(held);
    assert!(client.stream().is_ok());
}

#[test]
fn a_key_may_have_quotas_of_its_own() {
    let clients = clients();
    let connection = clients.connected(address(1));
    let quota = Quota {
        sessions: Some(3),
        streams: Some(1),
        bytes: Some(2 << 10),
        share: Some(4),
        recorded: None,
    };
    let key = || clients.with_key("small", quota, None, &connection);
    assert_eq!((key().id().share, connection.id().share), (4, 1));
    assert_eq!(key().id().group, key().id().own, "a key shares with nothing");
    let stream = key().stream().unwrap();
    let error = key().stream().unwrap_err();
    assert_eq!(
        error.to_string(),
        "this key has no room for another stream; allowed at a time: 1 streams (max_streams of the key)"
    );
    let error = key().memory(3 << 10).unwrap_err();
    assert!(
        error.to_string().contains("(transfer_memory_mib of the key)"),
        "{error}"
    );
    // A new quota counts from zero, on the same connection.
    let wider = Quota {
        streams: Some(2),
        ..quota
    };
    assert!(
        clients
            .with_key("small", wider, None, &connection)
            .stream()
            .is_ok()
    );
    drop(stream);
}

#[test]
fn sessions_of_a_quota_count_until_they_are_gone() {
    let clients = clients();
    let connection = clients.connected(address(1));
    let quota = Quota {
        sessions: Some(3),
        ..Quota::default()
    };
    let key = clients.with_key("small", quota, None, &connection);
    let mut both = key.sessions(2).unwrap();
    let (a, b) = (both.split().unwrap(), both.split().unwrap());
    assert!(both.split().is_none());
    let coming = key.sessions(1).unwrap();
    let error = key.sessions(1).unwrap_err();
    assert_eq!(
        error.to_string(),
        "this key has no room for as many sessions; allowed at a time: 3 sessions (max_sessions of the key)"
    );
    assert!(!error.never && key.sessions(4).unwrap_err().never);
    // What could not be opened is free again, and so is what is closed.
    drop(coming);
    assert!(key.sessions(1).is_ok());
    drop(b);
    assert!(key.sessions(2).is_ok() && key.sessions(3).is_err());
    drop(a);
    let usual = clients.with_key("large", Quota::default(), None, &connection);
    assert!(usual.sessions(1000).is_ok());
}

#[test]
fn sessions_count_for_their_address_when_the_connection_is_gone() {
    let clients = clients();
    let mut first = clients.connected(address(1)).sessions(1000).unwrap();
    let open: Vec<_> = std::iter::from_fn(|| first.split()).collect();
    let again = clients.connected(address(1));
    let error = again.sessions(501).unwrap_err();
    assert_eq!(
        error.to_string(),
        "this address has no room for as many sessions; allowed at a time: 1500 sessions (a share of max_sessions)"
    );
    assert!(again.has_room_for(500) && !again.has_room_for(501));
    assert!(again.sessions(500).is_ok());
    assert!(clients.connected(address(2)).sessions(1000).is_ok());
    drop(open);
    assert!(again.sessions(1000).is_ok());
}

#[test]
fn unused_accounts_are_forgotten_and_others_are_not() {
    let clients = clients();
    let connection = clients.connected(address(1));
    let quota = Quota {
        sessions: Some(3),
        ..Quota::default()
    };
    let with_session = clients.with_key("session", quota, None, &connection);
    let _session = with_session.sessions(3).unwrap().split().unwrap();
    drop(with_session);
    let _stream = clients
        .with_key(
            "stream",
            Quota {
                streams: Some(1),
                ..quota
            },
            None,
            &connection,
        )
        .stream()
        .unwrap();
    for number in 0..2 * MANY_ACCOUNTS {
        clients.with_key(&number.to_string(), Quota::default(), None, &connection);
    }
    assert!(clients.by_key.lock().unwrap().len() <= MANY_ACCOUNTS);
    let again = clients.with_key("session", quota, None, &connection);
    assert!(again.sessions(3).is_err());
    let again = clients.with_key(
        "stream",
        Quota {
            streams: Some(1),
            ..quota
        },
        None,
        &connection,
    );
    assert!(again.stream().is_err());
}
