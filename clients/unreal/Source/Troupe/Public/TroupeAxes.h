// From Troupe's frame of reference (right-handed, X left, Y up, Z ahead, metres) to Unreal's (left-handed, X ahead, Y right, Z up,
// centimetres) and back. Nothing of the engine is included, so that a test without it can hold the functions against
// clients/conventions/poses.json.
#pragma once

namespace TroupeAxes
{
/// Three numbers.
template <typename Real>
struct TVec3
{
	Real X, Y, Z;
};

/// A unit quaternion.
template <typename Real>
struct TQuat4
{
	Real X, Y, Z, W;
};

/// A position, offset or velocity in Unreal's frame.
template <typename Real>
constexpr TVec3<Real> PositionToUnreal(TVec3<Real> P)
{
	return {P.Z * 100, -P.X * 100, P.Y * 100};
}

/// A position, offset or velocity in Troupe's frame.
template <typename Real>
constexpr TVec3<Real> PositionToTroupe(TVec3<Real> P)
{
	return {-P.Y / 100, P.Z / 100, P.X / 100};
}

/// A rotation in Unreal's frame, relative to the world or to a parent. A mirror turns the axis of a rotation around.
template <typename Real>
constexpr TQuat4<Real> RotationToUnreal(TQuat4<Real> Q)
{
	return {-Q.Z, Q.X, -Q.Y, Q.W};
}

/// A rotation in Troupe's frame.
template <typename Real>
constexpr TQuat4<Real> RotationToTroupe(TQuat4<Real> Q)
{
	return {Q.Y, -Q.Z, -Q.X, Q.W};
}

/// A yaw in degrees in Unreal's frame, of a heading in radians.
template <typename Real>
constexpr Real YawToUnreal(Real Heading)
{
	return -Heading * Real(57.29577951308232);
}

/// A heading in radians in Troupe's frame, of a yaw in degrees.
template <typename Real>
constexpr Real HeadingToTroupe(Real Yaw)
{
	return -Yaw / Real(57.29577951308232);
}
} // namespace TroupeAxes
