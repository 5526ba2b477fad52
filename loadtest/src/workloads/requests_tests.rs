use super::*;

fn folder(list: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("requests.json"), list).unwrap();
    let request = v1::InBetweenRequest {
        pack: String::new(),
        characters: vec![v1::Character {
            frame_count: Some(64),
            ..v1::Character::default()
        }],
        skeleton: String::new(),
    };
    std::fs::write(folder.path().join("0.pb"), request.encode_to_vec()).unwrap();
    std::fs::write(folder.path().join("0.bin"), [1, 2, 3]).unwrap();
    folder
}

const LIST: &str =
    r#"{"version": 1, "requests": [{"grpc": "0.pb", "body": "0.bin", "frames": 64, "answer_bytes": 9}]}"#;

fn plain() -> Protocol {
    Protocol::Http { headers: Vec::new() }
}

#[test]
fn a_folder_gives_the_same_problem_in_every_form() {
    let folder = folder(LIST);
    let [grpc, json, http] =
        [Protocol::Grpc, Protocol::Json, plain()].map(|p| from_folder(folder.path(), &p).unwrap().remove(0));
    assert!(
        v1::InBetweenRequest::decode(grpc.body.clone())
            .unwrap()
            .characters
            .len()
            == 1
    );
    assert_eq!(json.body[0], b'{');
    assert_eq!(*http.body, [1, 2, 3]);
    assert_eq!((http.answer_bytes, grpc.answer_bytes), (Some(9), None));
    for item in [grpc, json, http] {
        assert_eq!((item.characters, item.frames), (1, Some(64)));
    }
}

#[test]
fn errors_of_a_folder_name_the_file_and_the_field() {
    for (list, wanted) in [
        ("{", "EOF"),
        (r#"{"version": 2, "requests": []}"#, "version is 2; allowed: 1"),
        (
            r#"{"version": 1, "requests": [{"body": "0.bin"}]}"#,
            "requests[0].grpc",
        ),
        (r#"{"version": 1, "requests": [{"grpc": "no.pb"}]}"#, "no.pb"),
        (
            r#"{"version": 1, "requests": [{"grpc": "0.bin"}]}"#,
            "not an InBetweenRequest",
        ),
    ] {
        let folder = folder(list);
        let error = from_folder(folder.path(), &Protocol::Grpc)
            .unwrap_err()
            .to_string();
        assert!(error.contains(wanted), "{list}: {error}");
    }
}

#[test]
fn requests_are_sent_in_turn_and_some_are_checked() {
    let items = from_folder(folder(LIST).path(), &plain()).unwrap();
    let two = vec![
        items[0].clone(),
        Item {
            frames: None,
            ..items[0].clone()
        },
    ];
    let set = RequestSet::new(two, 3).unwrap();
    assert_eq!(
        [0, 1, 2].map(|n| set.item(n).frames.is_some()),
        [true, false, true]
    );
    assert_eq!([0, 1, 2, 3].map(|n| set.is_sample(n)), [true, false, false, true]);
    assert!(RequestSet::new(Vec::new(), 0).is_none());
}
