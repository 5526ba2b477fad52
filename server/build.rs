//! Has cargo build the server again when `scripts/docs.sh` has filled `site/`: the macro that
//! embeds files does not see new ones.

fn main() {
    println!("cargo::rerun-if-changed=site");
}
