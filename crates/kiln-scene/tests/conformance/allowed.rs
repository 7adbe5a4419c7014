//! Errors of the validator that need no word, because they cannot change a picture, each with the reason.

use crate::judge::Fault;

struct Allowed {
    code: &'static str,
    /// What the pointer must end with.
    place_end: &'static str,
    reason: &'static str,
}

const fn allow(code: &'static str, place_end: &'static str, reason: &'static str) -> Allowed {
    Allowed { code, place_end, reason }
}

const UNREAD_TANGENTS: &str = "only tangents that a texture needs are read; those are repaired and noted";
const OWN_BOUNDS: &str = "bounds are computed from the values; the declared ones are not read";
const UPLOAD_HINT: &str = "a hint for uploading buffers as they are, which Kiln does not do";
const UNSHOWN: &str = "pictures that nothing drawn shows are not fetched; missing buffers are refused";

const ALLOWED: [Allowed; 6] = [
    allow("ACCESSOR_INVALID_SIGN", "/TANGENT", UNREAD_TANGENTS),
    allow("ACCESSOR_VECTOR3_NON_UNIT", "/TANGENT", UNREAD_TANGENTS),
    allow("ACCESSOR_MAX_MISMATCH", "", OWN_BOUNDS),
    allow("ACCESSOR_MIN_MISMATCH", "", OWN_BOUNDS),
    allow("BUFFER_VIEW_TARGET_OVERRIDE", "", UPLOAD_HINT),
    allow("IO_ERROR", "", UNSHOWN),
];

/// Why a fault needs no word.
pub(crate) fn reason(fault: &Fault) -> Option<&'static str> {
    let fits = |it: &&Allowed| it.code == fault.code && fault.pointer.ends_with(it.place_end);
    ALLOWED.iter().find(fits).map(|it| it.reason)
}
