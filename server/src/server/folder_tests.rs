use super::*;

/// A copy of the pack `open` with another version.
fn add(root: &Path, folder: &str, version: &str) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/open");
    let folder = root.join(folder);
    std::fs::create_dir(&folder).unwrap();
    for entry in std::fs::read_dir(&source).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_owned();
        if name.to_string_lossy().ends_with(".onnx") {
            std::fs::copy(&path, folder.join(name)).unwrap();
        }
    }
    let manifest = std::fs::read_to_string(source.join(MANIFEST_FILE)).unwrap();
    let line = manifest
        .lines()
        .find(|line| line.starts_with("version = "))
        .unwrap();
    let manifest = manifest.replacen(line, &format!("version = {version:?}"), 1);
    std::fs::write(folder.join(MANIFEST_FILE), manifest).unwrap();
    folder
}

#[test]
fn of_several_versions_the_newest_serves() {
    let root = tempfile::tempdir().unwrap();
    for (folder, version) in [("a", "0.9.0"), ("b", "0.10.0"), ("c", "0.2.0")] {
        add(root.path(), folder, version);
    }
    let config = Config::local(root.path()).unwrap();
    let packs = load_packs(&config).unwrap();
    let versions: Vec<_> = packs.iter().map(|pack| pack.manifest.version.as_str()).collect();
    assert_eq!(versions, ["0.10.0"]);
    let stock = FolderPacks::new(config.clone()).stock().unwrap();
    let offers: Vec<_> = stock.offers.iter().map(|offer| offer.version.as_str()).collect();
    assert_eq!(offers, ["0.9.0", "0.10.0", "0.2.0"]);
    add(root.path(), "d", "0.9.0");
    assert_eq!(load_packs(&config).unwrap()[0].manifest.version, "0.10.0");
    add(root.path(), "e", "0.10.0");
    let error = load_packs(&config).unwrap_err().to_string();
    assert!(error.contains("/e: "), "{error}");
}

#[test]
fn a_look_sees_changed_files_and_broken_manifests() {
    let root = tempfile::tempdir().unwrap();
    let folder = add(root.path(), "a", "1");
    let packs = FolderPacks::new(Config::local(root.path()).unwrap());
    let look = || packs.look().unwrap().remove(&folder).unwrap();
    let first = look();
    assert_eq!(first.offer.as_ref().unwrap().version, "1");
    assert_eq!(first, look());
    std::fs::create_dir(folder.join("styles")).unwrap();
    std::fs::write(folder.join("styles/new.json"), "{}").unwrap();
    let second = look();
    assert_ne!(first.print, second.print, "a file in a folder of the pack");
    std::fs::write(folder.join(MANIFEST_FILE), "version =").unwrap();
    assert_eq!(look().offer, None);
    let stock = packs.stock().unwrap();
    assert!(
        stock.offers.is_empty() && stock.unusable[0].contains("pack.toml"),
        "{stock:?}"
    );
}

#[test]
fn files_of_networks_that_are_missing_or_other_are_refused_with_the_reason() {
    let root = tempfile::tempdir().unwrap();
    let folder = add(root.path(), "a", "1");
    let packs = FolderPacks::new(Config::local(root.path()).unwrap());
    let offer = packs.stock().unwrap().offers.remove(0);
    assert_eq!(packs.read(&offer).unwrap().manifest.version, "1");
    let file = folder.join("pose.onnx");
    let mut bytes = std::fs::read(&file).unwrap();
    bytes[100] ^= 1;
    std::fs::write(&file, bytes).unwrap();
    let error = packs.read(&offer).unwrap_err().to_string();
    assert!(error.contains("sha256:"), "{error}");
    std::fs::remove_file(&file).unwrap();
    let error = packs.read(&offer).unwrap_err().to_string();
    assert!(
        error.contains("cannot read") && error.contains("pose.onnx"),
        "{error}"
    );
}
