//! Connections to servers.

use std::ffi::{CString, c_char};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use tokio::runtime::{Builder, Runtime};
use troupe_client::{ApiKey, Client, ClientCertificate, ConnectOptions};

use crate::handles::{Open, entry, get, insert, remove};
use crate::sized::{Versioned, check, given, read, text as argument, write};
use crate::status::{Failure, TroupeStatus, text};

/// A connection to a server. Zero is none.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TroupeConnection {
    /// The number of the handle.
    pub id: u64,
}

/// How to connect. Fields that are zero take their defaults.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TroupeConnectOptions {
    /// `sizeof(TroupeConnectOptions)`.
    pub size: u32,
    /// Time to open the connection, milliseconds. Zero: 5000.
    pub connect_timeout_ms: u32,
    /// Time for a call, from its first byte to the last of the answer, milliseconds. Zero: 60000.
    pub request_timeout_ms: u32,
    /// Zero.
    pub reserved: u32,
    /// Address of the server, such as `http://127.0.0.1:8080`. Addresses with `https://` use TLS.
    pub url: *const c_char,
    /// Key of the client, if the server asks for one.
    pub key: *const c_char,
    /// File (PEM) with the certificates of the authorities to trust. Null: those of the system.
    pub ca_file: *const c_char,
    /// File (PEM) with the client's certificate, for a server that asks for one. It goes with
    /// `key_file`.
    pub certificate_file: *const c_char,
    /// File (PEM) with the private key of `certificate_file`.
    pub key_file: *const c_char,
}

impl Versioned for TroupeConnectOptions {
    const NAME: &'static str = "TroupeConnectOptions";
}

/// The packs of a server. Texts and array hold until the next `troupe_packs` with this connection,
/// or until it is closed.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TroupePacks {
    /// `sizeof(TroupePacks)`.
    pub size: u32,
    /// Number of packs.
    pub count: u32,
    /// Names that `troupe_pack_open` takes: `count` of them.
    pub names: *const *const c_char,
    /// Name of the server's default pack. Empty: it has none.
    pub default_name: *const c_char,
}

impl Versioned for TroupePacks {
    const NAME: &'static str = "TroupePacks";
}

/// A client with a runtime of its own.
pub(crate) struct Connection {
    pub(crate) client: Client,
    pub(crate) runtime: Runtime,
    /// The answer of the last `troupe_packs`.
    names: Mutex<Names>,
}

/// Texts, and their addresses for C.
#[derive(Default)]
pub(crate) struct Names {
    texts: Vec<CString>,
    addresses: Vec<*const c_char>,
}

// SAFETY: the addresses are those of the texts beside them, which do not change.
unsafe impl Send for Names {}
// SAFETY: as above.
unsafe impl Sync for Names {}

impl Names {
    /// Keeps these texts.
    pub(crate) fn of<'a>(texts: impl IntoIterator<Item = &'a str>) -> Self {
        let texts: Vec<CString> = texts.into_iter().map(text).collect();
        let addresses = texts.iter().map(|text| text.as_ptr()).collect();
        Self { texts, addresses }
    }

    /// The address of the array.
    pub(crate) fn as_ptr(&self) -> *const *const c_char {
        self.addresses.as_ptr()
    }

    /// The text at this index, or an empty one.
    pub(crate) fn get(&self, index: usize) -> *const c_char {
        self.texts.get(index).map_or(c"".as_ptr(), |text| text.as_ptr())
    }

    /// Number of texts.
    pub(crate) fn len(&self) -> u32 {
        u32::try_from(self.texts.len()).unwrap_or(u32::MAX)
    }
}

/// Opens a connection. It has one thread of its own, which ends when the connection and all of its
/// crowds are closed.
///
/// # Safety
/// `options` is null or points to options whose `size` is set, and whose texts end with NUL. `out`
/// is null or can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_connect(
    options: *const TroupeConnectOptions,
    out: *mut TroupeConnection,
) -> TroupeStatus {
    entry(|| {
        if out.is_null() {
            return Err(Failure::Null("out"));
        }
        // SAFETY: the caller vouches for `options` and its texts.
        let (url, options) = unsafe { connect_options(options) }?;
        let runtime = Builder::new_multi_thread()
            .worker_threads(1)
            .thread_name("troupe")
            .enable_all()
            .build()?;
        let client = runtime.block_on(Client::connect_with(&url, options))?;
        let id = insert(Open::Connection(Arc::new(Connection {
            client,
            runtime,
            names: Mutex::default(),
        })));
        // SAFETY: `out` is not null, and the caller vouches for it.
        unsafe { out.write(TroupeConnection { id }) };
        Ok(TroupeStatus::Ok)
    })
}

/// Reads the options.
///
/// # Safety
/// As [`troupe_connect`].
unsafe fn connect_options(from: *const TroupeConnectOptions) -> Result<(String, ConnectOptions), Failure> {
    // SAFETY: the caller vouches for all of these.
    unsafe {
        let from = read("options", from)?;
        if from.url.is_null() {
            return Err(Failure::Null("options.url"));
        }
        let url = argument("options.url", from.url)?;
        let mut options = ConnectOptions {
            key: given("options.key", from.key)?.map(ApiKey::from),
            ..ConnectOptions::default()
        };
        if from.connect_timeout_ms > 0 {
            options.connect_timeout = Duration::from_millis(from.connect_timeout_ms.into());
        }
        if from.request_timeout_ms > 0 {
            options.request_timeout = Duration::from_millis(from.request_timeout_ms.into());
        }
        options.tls.ca = given("options.ca_file", from.ca_file)?.map(PathBuf::from);
        let certificate = given("options.certificate_file", from.certificate_file)?;
        let key = given("options.key_file", from.key_file)?;
        options.tls.client = match (certificate, key) {
            (Some(certificate), Some(key)) => Some(ClientCertificate {
                certificate: certificate.into(),
                key: key.into(),
            }),
            (None, None) => None,
            (Some(_), None) => return Err(Failure::Null("options.key_file")),
            (None, Some(_)) => return Err(Failure::Null("options.certificate_file")),
        };
        Ok((url, options))
    }
}

/// Lists the packs of the server.
///
/// # Safety
/// `out` is null, or points to a `TroupePacks` whose `size` is set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_packs(connection: TroupeConnection, out: *mut TroupePacks) -> TroupeStatus {
    entry(|| {
        // SAFETY: the caller vouches for `out`.
        unsafe { check("out", out) }?;
        let connection = get::<Connection>(connection.id)?;
        let mut kept = connection
            .names
            .try_lock()
            .map_err(|_| Failure::Busy { kind: "connection" })?;
        let packs = connection.runtime.block_on(connection.client.packs())?;
        let names = packs.iter().map(|pack| pack.name());
        let default = packs.iter().find(|pack| pack.description().is_default);
        // The default comes last, and does not count.
        let default = default.map_or("", |pack| pack.name());
        *kept = Names::of(names.chain([default]));
        let count = kept.len() - 1;
        let packs = TroupePacks {
            size: 0,
            count,
            names: kept.as_ptr(),
            default_name: kept.get(count as usize),
        };
        // SAFETY: the caller vouches for `out`.
        unsafe { write("out", out, packs) }?;
        Ok(TroupeStatus::Ok)
    })
}

/// Closes a connection. Its packs and crowds stay open until they are closed.
#[unsafe(no_mangle)]
pub extern "C" fn troupe_connection_close(connection: TroupeConnection) -> TroupeStatus {
    entry(|| {
        remove::<Connection>(connection.id)?;
        Ok(TroupeStatus::Ok)
    })
}
