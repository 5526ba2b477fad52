//! Tokens of an identity provider (JWT): checks their signatures and reads their claims.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use jsonwebtoken::errors::ErrorKind;
use jsonwebtoken::jwk::{AlgorithmParameters, EllipticCurve, Jwk, JwkSet, KeyAlgorithm, PublicKeyUse};
use jsonwebtoken::{Algorithm, DecodingKey, Validation, decode, decode_header, get_current_timestamp};

use super::clients::{Identity, Role};
use super::keys::{HASH_BYTES, hash};
use super::verify;
use troupe_base::tenant::{TENANT_NAMES, names_a_tenant};

/// Largest allowed difference between the clocks of the server and the provider, seconds.
const LEEWAY_S: u64 = 30;
/// Most checked tokens that are remembered.
const MOST_CHECKED: usize = 1024;
/// Longest name, bytes.
const MAX_NAME_BYTES: usize = 128;

/// Why a file of a provider's keys cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TokensError {
    /// The file cannot be read.
    #[error("jwks: cannot read {}: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        error: io::Error,
    },
    /// The file is no JWKS.
    #[error("jwks: {}: {error}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The parser's error.
        error: serde_json::Error,
    },
    /// The file has no key for an accepted algorithm.
    #[error("jwks: {} has no key to check signatures with; allowed: at least one for RS256, ES256 or EdDSA", path.display())]
    NoKey {
        /// The file.
        path: PathBuf,
    },
}

/// Why a token is not accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TokenError {
    /// It is no JWT, or it is signed with another algorithm.
    #[error("it is no JWT signed with RS256, ES256 or EdDSA")]
    Form,
    /// None of the provider's keys has signed it.
    #[error("its signature is not of a key in jwks")]
    Signature,
    /// The claim `exp` has passed.
    #[error("it has expired")]
    Expired,
    /// The claim `nbf` has not come yet.
    #[error("it is not valid yet")]
    Early,
    /// Another provider made it.
    #[error("its iss is not jwt_issuer")]
    Issuer,
    /// It is for another server.
    #[error("its aud is not jwt_audience")]
    Audience,
    /// A claim is missing or has an invalid value.
    #[error(
        "a claim is missing or out of range; allowed: exp; sub of 1 to {MAX_NAME_BYTES} bytes; role drive, author, admin or \
         metrics; optionally tenant of {TENANT_NAMES}"
    )]
    Claims,
}

/// Required values of claims.
#[derive(Debug, Clone, Default)]
pub struct TokenRules {
    /// The claim `iss`; if none, any value is accepted.
    pub issuer: Option<String>,
    /// The claim `aud`; if none, tokens must not have it.
    pub audience: Option<String>,
}

/// The claims that the server reads.
#[derive(serde::Deserialize)]
struct Claims {
    sub: String,
    role: Role,
    tenant: Option<String>,
    /// Seconds since 1970; the specification allows fractions.
    exp: f64,
}

/// Tokens with checked signatures, by their hashes. Checking an ES256 signature takes 0.1 ms of an
/// I/O thread, so it is only done once for each token.
#[derive(Debug, Default)]
struct Checked(Mutex<HashMap<[u8; HASH_BYTES], (Identity, u64)>>);

impl Checked {
    fn known(&self) -> MutexGuard<'_, HashMap<[u8; HASH_BYTES], (Identity, u64)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The identity in a token and its end, if the token was checked before and has not expired.
    fn find(&self, token: &[u8; HASH_BYTES]) -> Option<(Identity, u64)> {
        let known = self.known();
        let (identity, end_s) = known.get(token)?;
        (get_current_timestamp() < *end_s).then(|| (identity.clone(), *end_s))
    }

    fn remember(&self, token: [u8; HASH_BYTES], identity: Identity, end_s: u64) {
        let mut known = self.known();
        if known.len() >= MOST_CHECKED {
            let now_s = get_current_timestamp();
            known.retain(|_, (_, end_s)| now_s < *end_s);
        }
        if known.len() >= MOST_CHECKED {
            known.clear();
        }
        known.insert(token, (identity, end_s));
    }
}

/// A key of the provider, with the checks for tokens that it signed.
#[derive(Debug)]
struct Key {
    id: Option<String>,
    algorithm: Algorithm,
    key: DecodingKey,
    validation: Validation,
}

/// The keys of the provider, and the tokens that were checked with them.
#[derive(Debug)]
pub struct Tokens {
    keys: Vec<Key>,
    checked: Checked,
}

impl Tokens {
    /// The keys of a JWKS file. Keys for other algorithms are left out.
    ///
    /// # Errors
    /// [`TokensError`], which names the file.
    pub fn load(path: &Path, rules: &TokenRules) -> Result<Self, TokensError> {
        verify::install();
        let text = std::fs::read(path).map_err(|error| TokensError::Read {
            path: path.to_owned(),
            error,
        })?;
        let set: JwkSet = serde_json::from_slice(&text).map_err(|error| TokensError::Invalid {
            path: path.to_owned(),
            error,
        })?;
        let mut keys = Vec::new();
        for jwk in &set.keys {
            match Key::of(jwk, rules) {
                Some(key) => keys.push(key),
                None => tracing::info!(
                    key = jwk.common.key_id.as_deref().unwrap_or_default(),
                    "a key of jwks is left out: it is not for signatures by RS256, ES256 or EdDSA"
                ),
            }
        }
        match keys.is_empty() {
            true => Err(TokensError::NoKey {
                path: path.to_owned(),
            }),
            false => Ok(Self {
                keys,
                checked: Checked::default(),
            }),
        }
    }

    /// The identity in a valid token, and seconds since 1970 from which on the token is refused.
    ///
    /// # Errors
    /// [`TokenError`] if the token is not accepted.
    pub(super) fn check(&self, token: &str) -> Result<(Identity, u64), TokenError> {
        let hash = hash(token);
        if let Some(known) = self.checked.find(&hash) {
            return Ok(known);
        }
        let claims = self.claims(token)?;
        let end_s = (claims.exp as u64).saturating_add(LEEWAY_S);
        let identity = identity(claims)?;
        self.checked.remember(hash, identity.clone(), end_s);
        Ok((identity, end_s))
    }

    /// The claims of a token, if its signature and its time are valid.
    fn claims(&self, token: &str) -> Result<Claims, TokenError> {
        let header = decode_header(token).map_err(|_| TokenError::Form)?;
        // The header only selects keys. The algorithm comes from the key, never from the token.
        let keys = self
            .keys
            .iter()
            .filter(|key| key.algorithm == header.alg && (header.kid.is_none() || key.id == header.kid));
        let mut error = match header.alg {
            Algorithm::RS256 | Algorithm::ES256 | Algorithm::EdDSA => TokenError::Signature,
            _ => TokenError::Form,
        };
        for key in keys {
            match decode::<Claims>(token, &key.key, &key.validation) {
                Ok(token) => return Ok(token.claims),
                Err(wrong) => error = why(wrong.kind()),
            }
            if error != TokenError::Signature {
                break;
            }
        }
        Err(error)
    }
}

fn identity(claims: Claims) -> Result<Identity, TokenError> {
    let Claims {
        sub, role, tenant, ..
    } = claims;
    let fits = |name: &str| (1..=MAX_NAME_BYTES).contains(&name.len());
    match fits(&sub) && tenant.as_deref().is_none_or(names_a_tenant) {
        true => Ok(Identity {
            name: sub.into(),
            role,
            tenant: tenant.map(Into::into),
        }),
        false => Err(TokenError::Claims),
    }
}

fn why(kind: &ErrorKind) -> TokenError {
    match kind {
        ErrorKind::InvalidSignature => TokenError::Signature,
        ErrorKind::ExpiredSignature => TokenError::Expired,
        ErrorKind::ImmatureSignature => TokenError::Early,
        ErrorKind::InvalidIssuer => TokenError::Issuer,
        ErrorKind::InvalidAudience => TokenError::Audience,
        ErrorKind::MissingRequiredClaim(claim) if claim == "iss" => TokenError::Issuer,
        ErrorKind::MissingRequiredClaim(claim) if claim == "aud" => TokenError::Audience,
        ErrorKind::MissingRequiredClaim(_) | ErrorKind::InvalidClaimFormat(_) | ErrorKind::Json(_) => {
            TokenError::Claims
        }
        _ => TokenError::Form,
    }
}

impl Key {
    /// None if the key is not for signatures by an accepted algorithm.
    fn of(jwk: &Jwk, rules: &TokenRules) -> Option<Self> {
        let (algorithm, named) = match &jwk.algorithm {
            AlgorithmParameters::RSA(_) => (Algorithm::RS256, KeyAlgorithm::RS256),
            AlgorithmParameters::EllipticCurve(key) if key.curve == EllipticCurve::P256 => {
                (Algorithm::ES256, KeyAlgorithm::ES256)
            }
            AlgorithmParameters::OctetKeyPair(key) if key.curve == EllipticCurve::Ed25519 => {
                (Algorithm::EdDSA, KeyAlgorithm::EdDSA)
            }
            _ => return None,
        };
        let common = &jwk.common;
        if common
            .key_algorithm
            .as_ref()
            .is_some_and(|algorithm| *algorithm != named)
        {
            return None;
        }
        if common
            .public_key_use
            .as_ref()
            .is_some_and(|purpose| *purpose != PublicKeyUse::Signature)
        {
            return None;
        }
        let mut validation = Validation::new(algorithm);
        validation.leeway = LEEWAY_S;
        validation.validate_nbf = true;
        let mut required = vec!["exp", "sub"];
        if let Some(issuer) = &rules.issuer {
            validation.set_issuer(&[issuer]);
            required.push("iss");
        }
        if let Some(audience) = &rules.audience {
            validation.set_audience(&[audience]);
            required.push("aud");
        }
        validation.set_required_spec_claims(&required);
        Some(Self {
            id: common.key_id.clone(),
            algorithm,
            key: DecodingKey::from_jwk(jwk).ok()?,
            validation,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Key and token of RFC 7515, appendix A.2. The token has no subject and has expired.
    const MODULUS: &str = "ofgWCuLjybRlzo0tZWJjNiuSfb4p4fAkd_wWJcyQoTbji9k0l8W26mPddxHmfHQp-Vaw-4qPCJrcS2mJPMEzP1Pt0Bm4d4QlL-yRT-SFd2lZS-pCgNMsD1W_YpRPEwOWvG6b32690r2jZ47soMZo9wGzjb_7OMg0LOL-bSf63kpaSHSXndS5z5rexMdbBYUsLA9e-KXBdQOS-UTo7WTBEMa2R2CapHg665xsmtdVMTBQY4uDZlxvb3qCo5ZwKh9kG4LT6_I5IhlJH7aGhyxXFvUK-DWNmoudF8NAco9_h9iaGNj8q2ethFkMLs91kzk2PAcDTW9gb54h4FRWyuXpoQ";
    const TOKEN: &str = "eyJhbGciOiJSUzI1NiJ9.eyJpc3MiOiJqb2UiLA0KICJleHAiOjEzMDA4MTkzODAsDQogImh0dHA6Ly9leGFtcGxlLmNvbS9pc19yb290Ijp0cnVlfQ.cC4hiUPoj9Eetdgtv3hF80EGrhuB__dzERat0XF9g2VtQgr9PJbu3XOiZj5RZmh7AAuHIm4Bh-0Qc_lF5YKt_O8W2Fp5jujGbds9uJdbF9CUAr7t1dnZcAcQjbKBYNX4BAynRFdiuB--f_nZLgrnbyTyWzO75vRK5h6xBArLIARNPvkSjtQBMHlb1L07Qe7K0GarZRmB_eSN9383LcOLn6_dO--xi12jzDwusC-eOkHWEsqtFZESc6BfI7noOPqvhJ1phCnvWh6IeYI2w9QOYEUipUTI8np6LbgGY9Fs98rqVt5AXLIhWkWywlVmtVrBp0igcN_IoypGlUPQGe77Rw";

    fn load(jwks: &str) -> Result<Tokens, TokensError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("jwks.json");
        std::fs::write(&path, jwks).unwrap();
        Tokens::load(&path, &TokenRules::default())
    }

    #[test]
    fn a_signature_by_rs256_is_checked_before_its_claims() {
        let key = format!(r#"{{"keys":[{{"kty":"RSA","n":"{MODULUS}","e":"AQAB"}}]}}"#);
        let tokens = load(&key).unwrap();
        assert_eq!(tokens.check(TOKEN), Err(TokenError::Claims));
        for (part, forged) in [(".eyJpc3MiOiJqb2Ui", ".eyJpc3MiOiJqb2Yi"), (".cC4h", ".cC4i")] {
            assert!(TOKEN.contains(part));
            let forged = TOKEN.replace(part, forged);
            assert_eq!(tokens.check(&forged), Err(TokenError::Signature));
        }
    }

    #[test]
    fn a_token_is_remembered_until_its_time_is_up() {
        let identity = |name: &str| Identity {
            name: name.into(),
            role: Role::Drive,
            tenant: None,
        };
        let (checked, now_s) = (Checked::default(), get_current_timestamp());
        checked.remember([1; HASH_BYTES], identity("late"), now_s - 1);
        checked.remember([2; HASH_BYTES], identity("a"), now_s + 60);
        assert_eq!(checked.find(&[1; HASH_BYTES]), None);
        assert_eq!(checked.find(&[2; HASH_BYTES]), Some((identity("a"), now_s + 60)));
        assert_eq!(checked.find(&[3; HASH_BYTES]), None);
        for number in 0..MOST_CHECKED {
            checked.remember(hash(&number.to_string()), identity("b"), now_s + 60);
            assert!(checked.known().len() <= MOST_CHECKED);
        }
    }

    #[test]
    fn keys_for_other_algorithms_are_left_out() {
        let rsa = |more: &str| format!(r#"{{"kty":"RSA","n":"{MODULUS}","e":"AQAB"{more}}}"#);
        let secret = r#"{"kty":"oct","k":"c2VjcmV0"}"#;
        let other = r#"{"kty":"new"}"#;
        for keys in [
            String::new(),
            secret.to_owned(),
            other.to_owned(),
            rsa(r#","alg":"PS256""#),
            rsa(r#","use":"enc""#),
        ] {
            let error = load(&format!(r#"{{"keys":[{keys}]}}"#)).unwrap_err().to_string();
            assert!(
                error.contains("has no key to check signatures with"),
                "{keys}: {error}"
            );
        }
        let all = format!(
            r#"{{"keys":[{secret},{other},{}]}}"#,
            rsa(r#","use":"sig","alg":"RS256""#)
        );
        assert_eq!(load(&all).unwrap().keys.len(), 1);
        let error = load("{").unwrap_err().to_string();
        assert!(
            error.starts_with("jwks: ") && error.contains("jwks.json"),
            "{error}"
        );
        let error = Tokens::load(Path::new("/nowhere/jwks.json"), &TokenRules::default()).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("jwks: cannot read /nowhere/jwks.json"),
            "{error}"
        );
    }
}
