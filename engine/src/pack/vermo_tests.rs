use super::*;
use crate::vermo::toy::{MANIFEST, lexicon};

fn tiny() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vermo")
}

#[test]
fn a_language_pack_loads_its_lexicon() {
    let pack = Pack::load(&tiny()).unwrap();
    assert_eq!(
        pack.files(),
        [
            "language.onnx",
            "encoder.onnx",
            "decoder.onnx",
            "flow.onnx",
            "tokenizer.json"
        ]
    );
    let lexicon = pack.lexicon.unwrap();
    let pieces = lexicon.pieces("  An ANGRY person's walk: slowly!").unwrap();
    assert_eq!(lexicon.text(&pieces).unwrap(), "an angry persons walk slowly");
    assert_eq!(lexicon.pieces("?!").unwrap(), [] as [u32; 0]);
    assert!(lexicon.words().any(|word| word == "walks"));
    assert_eq!(
        lexicon.unknown_words("An old robot Walks, then the ROBOT 走 and a dog's left hand."),
        ["robot", "then", "走", "dog's"]
    );
}

#[test]
fn a_pack_without_a_flow_decoder_lists_no_file_for_it() {
    let manifest = Manifest::parse(&MANIFEST.replace("flow_steps = 4", "flow_steps = 0")).unwrap();
    let pack = Pack::from_manifest(manifest, Path::new("toy")).unwrap();
    assert_eq!(
        pack.files(),
        ["language.onnx", "encoder.onnx", "decoder.onnx", "tokenizer.json"]
    );
}

#[test]
fn files_that_contradict_the_manifest_are_detected() {
    let folder = std::env::temp_dir().join(format!("troupe-pack-vermo-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for file in std::fs::read_dir(tiny()).unwrap() {
        let file = file.unwrap();
        std::fs::copy(file.path(), folder.join(file.file_name())).unwrap();
    }
    let found = |change: &dyn Fn()| {
        change();
        Pack::load(&folder).unwrap_err().problem.to_string()
    };
    let text = std::fs::read_to_string(tiny().join(MANIFEST_FILE)).unwrap();
    let write = |text: &str| std::fs::write(folder.join(MANIFEST_FILE), text).unwrap();
    let other_pieces = text.replace("text_pieces = 160", "text_pieces = 161");
    assert_eq!(
        found(&|| write(&other_pieces)),
        "pack.toml: vermo.text_pieces is 161; allowed: 160, the number of ids in tokenizer.json, which count from 0"
    );
    let words = folder.join("words.txt");
    assert!(found(&|| (write(&text), std::fs::remove_file(&words).unwrap()).1).contains("words.txt"));
    std::fs::copy(tiny().join("words.txt"), &words).unwrap();
    let tokenizer = folder.join("tokenizer.json");
    assert!(found(&|| std::fs::write(&tokenizer, "{}").unwrap()).contains("content_hash"));
    let hash = content_hash(
        &folder,
        &Pack::from_manifest(Manifest::parse(&text).unwrap(), &folder)
            .unwrap()
            .files(),
    );
    let start = text.find("sha256:").unwrap();
    let rehashed = text.replace(&text[start..start + 71], &hash.unwrap());
    assert!(found(&|| write(&rehashed)).starts_with("tokenizer.json: "));
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn pieces_equal_those_of_the_tokenizer_library() {
    let lexicon = lexicon();
    assert_eq!(lexicon.pieces("Ab 1").unwrap(), [0, 1, 2, 0, 28]);
    assert_eq!(lexicon.text(&[0, 1, 2, 0, 28]).unwrap(), "ab 1");
}

#[test]
fn the_longest_wording_of_a_style_is_taken_out_of_a_text() {
    let lexicon = lexicon().with_styles("Angry\nold\nlike an old man\n\nold man\nin anger\n");
    for (text, left) in [
        ("An ANGRY person walks!", "a person walks"),
        ("walk like an old man for a while", "walk for a while"),
        ("an old angry ox waves", "an ox waves"),
        ("a walk in anger", "a walk"),
    ] {
        assert_eq!(lexicon.unstyled(text).as_deref(), Some(left));
    }
    for text in ["a person walks", "walk in a golden anger", "angry", ""] {
        assert_eq!(lexicon.unstyled(text), None, "{text}");
    }
    assert_eq!(lexicon.style().as_deref(), Some("old"));
}

#[test]
fn a_pack_with_guidance_needs_its_list_of_styles() {
    let folder = std::env::temp_dir().join(format!("troupe-pack-guided-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for file in std::fs::read_dir(tiny()).unwrap() {
        let file = file.unwrap();
        std::fs::copy(file.path(), folder.join(file.file_name())).unwrap();
    }
    let text = std::fs::read_to_string(tiny().join(MANIFEST_FILE)).unwrap();
    let guided = text.replace("repetition = 1.1", "repetition = 1.1\nstyle_guidance = 4.0");
    std::fs::write(folder.join(MANIFEST_FILE), guided).unwrap();
    let problem = Pack::load(&folder).unwrap_err().problem.to_string();
    assert!(problem.contains("styles.txt"), "{problem}");
    std::fs::write(folder.join("styles.txt"), "angry\n").unwrap();
    let pack = Pack::load(&folder).unwrap();
    assert_eq!(pack.manifest.vermo.unwrap().content_guidance, 1.0);
    let lexicon = pack.lexicon.unwrap();
    assert_eq!(lexicon.unstyled("an angry walk").as_deref(), Some("a walk"));
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn every_mistake_in_the_table_is_named() {
    for (from, to, said) in [
        (
            "family = \"vermo\"",
            "family = \"other\"\nmax_targets = 4",
            "vermo is present; allowed: none",
        ),
        (
            "family = \"vermo\"",
            "family = \"vermo\"\nroot_choices = 16",
            "root_choices is 16; allowed: none",
        ),
        (
            "layers = 2",
            "layers = 0",
            "vermo.layers is 0; allowed: 1 to 65536",
        ),
        ("layers = 2", "layer = 2", "unknown field `layer`"),
        (
            "repetition = 1.0",
            "repetition = 1.0\nstyle_guidance = 0.5",
            "vermo.style_guidance is 0.5; allowed: 1 to 16",
        ),
        (
            "positions = 80",
            "positions = 53",
            "vermo.positions is 53; allowed: 54 to 16384",
        ),
        (
            "frames_per_token = 4",
            "frames_per_token = 2",
            "frames_per_token is 2; allowed: 4 to 4",
        ),
        (
            "context_frames = 16",
            "context_frames = 17",
            "context_frames is 17; allowed: a multiple of 4",
        ),
        (
            "audio_codes = 5",
            "audio_codes = 0",
            "vermo.tasks is music_to_dance; allowed: tasks without audio, because audio_codes is 0",
        ),
        (
            "\"inbetween\"",
            "\"unconditional\"",
            "vermo.tasks is unconditional; allowed: each task once",
        ),
        ("\"inbetween\"", "\"dreaming\"", "unknown variant `dreaming`"),
        (
            "\"text_to_motion\", ",
            "",
            "capabilities is text present; allowed: only with the task text_to_motion",
        ),
        (
            "describe = true",
            "describe = false",
            "capabilities is describe missing",
        ),
        (
            "max_agents = 3",
            "max_agents = 1",
            "capabilities is agents present",
        ),
        (
            "describe = true",
            "describe = true\nlive = true",
            "capabilities is live present; allowed: none, because of the family",
        ),
        (
            "flow_steps = 4",
            "flow_steps = 257",
            "vermo.flow_steps is 257; allowed: 0 to 256",
        ),
        (
            "temperature = 1.0",
            "temperature = 2.5",
            "vermo.temperature is 2.5; allowed: 0 to 2",
        ),
        (
            "top_p = 1.0",
            "top_p = 0.0",
            "vermo.top_p is 0; allowed: more than 0 to 1",
        ),
        (
            "repetition = 1.0",
            "repetition = nan",
            "vermo.repetition is NaN; allowed: 1 to 10",
        ),
    ] {
        assert!(MANIFEST.contains(from), "{from}");
        let changed = MANIFEST.replacen(from, to, 1);
        let checked = Manifest::parse(&changed).and_then(|manifest| manifest.check());
        let error = checked.unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
    let (manifest, _) = MANIFEST.split_once("[vermo]").unwrap();
    let (_, skeleton) = MANIFEST.split_once("[skeleton]").unwrap();
    let bare = format!("{manifest}[skeleton]{skeleton}");
    let error = Manifest::parse(&bare).unwrap().check().unwrap_err().to_string();
    assert_eq!(error, "pack.toml: vermo is missing; allowed: the table [vermo]");
}
