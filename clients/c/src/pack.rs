//! Packs: their skeletons, styles and skills.

use std::ffi::{CString, c_char};
use std::sync::Arc;

use troupe_client::{Client, ClientError, Pack};

use crate::connection::{Connection, Names, TroupeConnection};
use crate::handles::{Open, entry, get, insert, remove};
use crate::sized::{Versioned, read, text as argument, write};
use crate::status::{Failure, TroupeStatus, text};

/// A pack of a server, on one skeleton. Zero is none.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TroupePack {
    /// The number of the handle.
    pub id: u64,
}

/// Which pack to open. Texts that are null or empty take the defaults.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TroupePackOptions {
    /// `sizeof(TroupePackOptions)`.
    pub size: u32,
    /// Zero.
    pub reserved: u32,
    /// Name of the pack. Default: the server's default pack.
    pub name: *const c_char,
    /// Name of the body, for packs with several. Default: the pack's.
    pub body: *const c_char,
    /// Name of a skeleton of your own that the server has, which characters shall wear. Default:
    /// none.
    pub skeleton: *const c_char,
}

impl Versioned for TroupePackOptions {
    const NAME: &'static str = "TroupePackOptions";
}

/// What there is to know of a pack. Texts and arrays hold until the pack is closed. Texts are never
/// null.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TroupePackInfo {
    /// `sizeof(TroupePackInfo)`.
    pub size: u32,
    /// Number of joints. Parents come before their children; frames use this order.
    pub joint_count: u32,
    /// Names of the joints.
    pub joint_names: *const *const c_char,
    /// Index of each joint's parent; -1 for the first joint.
    pub joint_parents: *const i32,
    /// Offset of each joint from its parent in the parent's frame while no joint turns, metres:
    /// three numbers each. That of the first joint is not used: frames have its position.
    pub joint_offsets: *const f32,
    /// Names of the joints that touch the ground: bit n of a frame's contacts is joint n of these.
    pub contact_names: *const *const c_char,
    /// Number of contact joints.
    pub contact_count: u32,
    /// Number of styles. Zero for a pack without live characters.
    pub style_count: u32,
    /// Names of the styles, sorted.
    pub style_names: *const *const c_char,
    /// Name of the style of characters that name none.
    pub default_style: *const c_char,
    /// Names of the skills.
    pub skill_names: *const *const c_char,
    /// Number of skills.
    pub skill_count: u32,
    /// Frames a second of the networks. Crowds come at 30, 50 or 60 frames a second.
    pub fps: f32,
    /// Name of the pack.
    pub name: *const c_char,
    /// Version of the pack.
    pub version: *const c_char,
    /// Licence of the weights.
    pub licence: *const c_char,
}

impl Versioned for TroupePackInfo {
    const NAME: &'static str = "TroupePackInfo";
}

/// A pack, and what C reads of it.
pub(crate) struct OpenPack {
    pub(crate) connection: Arc<Connection>,
    pub(crate) pack: Pack,
    joints: Names,
    parents: Vec<i32>,
    offsets: Vec<[f32; 3]>,
    contacts: Names,
    styles: Names,
    skills: Names,
    default_style: CString,
    name: CString,
    version: CString,
    licence: CString,
}

impl OpenPack {
    async fn open(connection: &Arc<Connection>, wanted: [&str; 3]) -> Result<Self, ClientError> {
        let client = &connection.client;
        let (pack, contacts) = on_skeleton(client, wanted).await?;
        let about = pack.description();
        let live = about.capabilities.iter().any(|of| of == "live");
        let styles = match live {
            true => client.styles(&pack).await?,
            false => Default::default(),
        };
        let joints = &pack.skeleton().joints;
        let parent = |of: Option<usize>| of.and_then(|of| i32::try_from(of).ok()).unwrap_or(-1);
        Ok(Self {
            connection: connection.clone(),
            joints: Names::of(joints.iter().map(|joint| joint.name.as_str())),
            parents: joints.iter().map(|joint| parent(joint.parent)).collect(),
            offsets: joints.iter().map(|joint| joint.offset_m.to_array()).collect(),
            contacts: Names::of(contacts.iter().map(String::as_str)),
            styles: Names::of(styles.styles.iter().map(|style| style.name.as_str())),
            skills: Names::of(about.skills.iter().map(|skill| skill.name.as_str())),
            default_style: text(&styles.default_style),
            name: text(pack.name()),
            version: text(&about.version),
            licence: text(&about.licence),
            pack,
        })
    }

    fn info(&self) -> TroupePackInfo {
        TroupePackInfo {
            size: 0,
            joint_count: self.joints.len(),
            joint_names: self.joints.as_ptr(),
            joint_parents: self.parents.as_ptr(),
            joint_offsets: self.offsets.as_ptr().cast(),
            contact_names: self.contacts.as_ptr(),
            contact_count: self.contacts.len(),
            style_count: self.styles.len(),
            style_names: self.styles.as_ptr(),
            default_style: self.default_style.as_ptr(),
            skill_names: self.skills.as_ptr(),
            skill_count: self.skills.len(),
            fps: self.pack.fps(),
            name: self.name.as_ptr(),
            version: self.version.as_ptr(),
            licence: self.licence.as_ptr(),
        }
    }
}

/// The pack on the wanted body and skeleton, and the names of its contact joints.
async fn on_skeleton(
    client: &Client,
    [name, body, worn]: [&str; 3],
) -> Result<(Pack, Vec<String>), ClientError> {
    let mut pack = client.pack(name).await?;
    // The list of packs, from which the default comes, has no bodies' joints.
    if name.is_empty() && !pack.description().bodies.is_empty() {
        pack = client.pack(pack.name()).await?;
    }
    let pack = pack.of_body(body)?;
    if !worn.is_empty() {
        let own = client.skeleton(worn, &pack).await?;
        let contacts = own.fit.clone().unwrap_or_default().contact_joints;
        return Ok((pack.wearing(&own)?, contacts));
    }
    let bodies = &pack.description().bodies;
    let contacts = match bodies.iter().find(|of| of.name == pack.body()) {
        Some(body) => body.contact_joints.clone(),
        None => pack.description().contact_joints.clone(),
    };
    Ok((pack, contacts))
}

/// Opens a pack.
///
/// # Safety
/// `options` is null or points to options whose `size` is set, and whose texts end with NUL. `out`
/// is null or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_pack_open(
    connection: TroupeConnection,
    options: *const TroupePackOptions,
    out: *mut TroupePack,
) -> TroupeStatus {
    entry(|| {
        if out.is_null() {
            return Err(Failure::Null("out"));
        }
        let connection = get::<Connection>(connection.id)?;
        // SAFETY: the caller vouches for `options` and its texts.
        let wanted = unsafe {
            let options = read("options", options)?;
            [
                argument("options.name", options.name)?,
                argument("options.body", options.body)?,
                argument("options.skeleton", options.skeleton)?,
            ]
        };
        let opened = OpenPack::open(&connection, wanted.each_ref().map(String::as_str));
        let id = insert(Open::Pack(Arc::new(connection.runtime.block_on(opened)?)));
        // SAFETY: `out` is not null, and the caller vouches for it.
        unsafe { out.write(TroupePack { id }) };
        Ok(TroupeStatus::Ok)
    })
}

/// What there is to know of a pack. It asks no server, and may be called from any thread.
///
/// # Safety
/// `out` is null, or points to a `TroupePackInfo` whose `size` is set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_pack_info(pack: TroupePack, out: *mut TroupePackInfo) -> TroupeStatus {
    entry(|| {
        let pack = get::<OpenPack>(pack.id)?;
        // SAFETY: the caller vouches for `out`.
        unsafe { write("out", out, pack.info()) }?;
        Ok(TroupeStatus::Ok)
    })
}

/// Closes a pack. Its crowds stay open until they are closed.
#[unsafe(no_mangle)]
pub extern "C" fn troupe_pack_close(pack: TroupePack) -> TroupeStatus {
    entry(|| {
        remove::<OpenPack>(pack.id)?;
        Ok(TroupeStatus::Ok)
    })
}
