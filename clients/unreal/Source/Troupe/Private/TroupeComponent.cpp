#include "TroupeComponent.h"

#include "Async/Async.h"
#include "Components/SkeletalMeshComponent.h"
#include "Engine/SkeletalMesh.h"
#include "GameFramework/Actor.h"
#include "HttpModule.h"
#include "Interfaces/IHttpResponse.h"
#include "TroupeAxes.h"

DEFINE_LOG_CATEGORY_STATIC(LogTroupe, Log, All);

namespace
{
using FReal3 = TroupeAxes::TVec3<double>;
using FReal4 = TroupeAxes::TQuat4<double>;

/** Whether a call worked. An error goes to the log. */
bool Worked(TroupeStatus Status)
{
	if (Status >= 0) return true;
	TroupeError Error{};
	Error.size = sizeof Error;
	troupe_last_error(&Error);
	UE_LOG(LogTroupe, Error, TEXT("%s"), UTF8_TO_TCHAR(Error.message));
	return false;
}

FString Vector(const FVector& V)
{
	const FReal3 P = TroupeAxes::PositionToTroupe<double>({V.X, V.Y, V.Z});
	return FString::Printf(TEXT("{\"x\":%.7g,\"y\":%.7g,\"z\":%.7g}"), P.X, P.Y, P.Z);
}

FString Rotation(const FQuat& Q)
{
	const FReal4 R = TroupeAxes::RotationToTroupe<double>({Q.X, Q.Y, Q.Z, Q.W});
	return FString::Printf(TEXT("{\"w\":%.7g,\"x\":%.7g,\"y\":%.7g,\"z\":%.7g}"), R.W, R.X, R.Y, R.Z);
}

/** Connects and opens a crowd of one character. */
TroupeCrowd OpenCrowd(const FString& Server, const FString& SkeletonName)
{
	const FTCHARToUTF8 Url(*Server), Skeleton(*SkeletonName);
	TroupeConnectOptions To{};
	To.size = sizeof To;
	To.url = Url.Get();
	TroupePackOptions Which{};
	Which.size = sizeof Which;
	Which.skeleton = Skeleton.Get();
	TroupeCharacter Character{};
	Character.seed = 1;
	TroupeCrowdOptions Options{};
	Options.size = sizeof Options;
	Options.rate_hz = 60;
	Options.characters = &Character;
	Options.character_count = 1;
	Options.character_size = sizeof Character;

	TroupeConnection Connection{};
	TroupePack Pack{};
	TroupeCrowd Crowd{};
	if (Worked(troupe_connect(&To, &Connection)))
	{
		if (Worked(troupe_pack_open(Connection, &Which, &Pack)))
		{
			Worked(troupe_crowd_open(Pack, &Options, &Crowd));
			troupe_pack_close(Pack);
		}
		troupe_connection_close(Connection); // the crowd keeps what it needs
	}
	return Crowd;
}
} // namespace

UTroupeComponent::UTroupeComponent()
{
	PrimaryComponentTick.bCanEverTick = true;
	PrimaryComponentTick.TickGroup = TG_PrePhysics;
}

FQuat UTroupeComponent::Facing() const
{
	return FQuat(FVector::UpVector, FMath::DegreesToRadians(MeshYaw));
}

void UTroupeComponent::BeginPlay()
{
	Super::BeginPlay();
	const auto Request = FHttpModule::Get().CreateRequest();
	Request->SetURL(Server + TEXT("/v1/skeletons/") + SkeletonName);
	Request->SetVerb(TEXT("PUT"));
	Request->SetHeader(TEXT("content-type"), TEXT("application/json"));
	Request->SetContentAsString(Joints());
	const TWeakObjectPtr<UTroupeComponent> Weak(this);
	Request->OnProcessRequestComplete().BindLambda(
		[Weak](FHttpRequestPtr, FHttpResponsePtr Answer, bool bSent)
		{
			UTroupeComponent* Self = Weak.Get();
			if (!Self || Self->bEnded) return;
			if (bSent && Answer.IsValid() && Answer->GetResponseCode() == 200) return Self->Open();
			UE_LOG(LogTroupe, Error, TEXT("The server does not take the skeleton: %s"),
				Answer.IsValid() ? *Answer->GetContentAsString() : TEXT("no answer"));
		});
	Request->ProcessRequest();
}

/** The joints of the mesh from the root bone on, in the reference pose, as the server takes them. */
FString UTroupeComponent::Joints()
{
	const USkeletalMeshComponent* Mesh = GetOwner()->FindComponentByClass<USkeletalMeshComponent>();
	if (!Mesh || !Mesh->GetSkeletalMeshAsset()) return TEXT("{}");
	const FReferenceSkeleton& Skeleton = Mesh->GetSkeletalMeshAsset()->GetRefSkeleton();
	const TArray<FTransform>& Local = Skeleton.GetRefBonePose();
	const FQuat Back = Facing().Inverse();
	TArray<FTransform> InMesh;
	TArray<int32> Kept;
	FString Names, Neutral;
	Pose.Names.Reset();
	for (int32 Bone = 0; Bone < Local.Num(); Bone++)
	{
		const int32 Parent = Skeleton.GetParentIndex(Bone);
		InMesh.Add(Parent < 0 ? Local[Bone] : Local[Bone] * InMesh[Parent]);
		const FName Name = Skeleton.GetBoneName(Bone);
		const bool bFirst = Name == RootBone;
		if (!bFirst && !Kept.Contains(Parent)) continue;
		Kept.Add(Bone);
		Pose.Names.Add(Name);
		FString Joint = FString::Printf(TEXT("{\"name\":\"%s\""), *Name.ToString());
		if (!bFirst)
		{
			Joint += FString::Printf(TEXT(",\"parent\":\"%s\""), *Skeleton.GetBoneName(Parent).ToString());
		}
		Joint += TEXT(",\"offset\":") + Vector(bFirst ? FVector::ZeroVector : Local[Bone].GetTranslation()) + TEXT("}");
		Names += (Names.IsEmpty() ? TEXT("") : TEXT(",")) + Joint;
		Neutral += (Neutral.IsEmpty() ? TEXT("") : TEXT(",")) + Rotation(Back * InMesh[Bone].GetRotation());
	}
	Pose.Rotations.Init(FQuat::Identity, Pose.Names.Num());
	return FString::Printf(TEXT("{\"joints\":{\"joints\":[%s],\"neutral\":[%s]}}"), *Names, *Neutral);
}

void UTroupeComponent::Open()
{
	Opening = Async(EAsyncExecution::Thread, [Where = Server, Name = SkeletonName] { return OpenCrowd(Where, Name); });
}

void UTroupeComponent::Move(float Ahead, float Right, const FString& Style)
{
	const FReal3 Velocity = TroupeAxes::PositionToTroupe<double>({Ahead, Right, 0});
	const FTCHARToUTF8 Name(*Style);
	TroupeLocomotion Locomotion{};
	Locomotion.size = sizeof Locomotion;
	Locomotion.velocity = {float(Velocity.X), 0, float(Velocity.Z)};
	Locomotion.style = Name.Get();
	if (Crowd.id != 0) Worked(troupe_crowd_move(Crowd, 0, &Locomotion));
}

void UTroupeComponent::TickComponent(float Seconds, ELevelTick Type, FActorComponentTickFunction* Function)
{
	Super::TickComponent(Seconds, Type, Function);
	if (Opening.IsValid() && Opening.IsReady())
	{
		Crowd = Opening.Get();
		Opening.Reset();
	}
	if (Crowd.id == 0) return;
	TroupeFrames Frames{};
	Frames.size = sizeof Frames;
	const TroupeStatus Status = troupe_crowd_read(Crowd, 0, &Frames);
	if (Status == TROUPE_STATUS_EMPTY) return;
	if (!Worked(Status))
	{
		troupe_crowd_close(Crowd);
		Crowd = {};
		return;
	}
	if (!Frames.present[0] || int32(Frames.joint_count) != Pose.Names.Num()) return;
	const float* P = Frames.root_positions;
	const FReal3 Root = TroupeAxes::PositionToUnreal<double>({P[0], P[1], P[2]});
	Pose.Root = Facing().RotateVector(FVector(Root.X, Root.Y, Root.Z));
	for (int32 Joint = 0; Joint < Pose.Names.Num(); Joint++)
	{
		const float* Q = Frames.rotations + 4 * Joint;
		const FReal4 R = TroupeAxes::RotationToUnreal<double>({Q[0], Q[1], Q[2], Q[3]});
		Pose.Rotations[Joint] = FQuat(R.X, R.Y, R.Z, R.W);
	}
	Pose.Rotations[0] = Facing() * Pose.Rotations[0];
	bHasPose = true;
}

bool UTroupeComponent::GetPose(FTroupePose& Out) const
{
	if (bHasPose) Out = Pose;
	return bHasPose;
}

void UTroupeComponent::EndPlay(const EEndPlayReason::Type Reason)
{
	bEnded = true;
	// Closing waits for the server, and for an opening that is under way.
	Async(EAsyncExecution::Thread,
		[Open = Crowd, Late = MoveTemp(Opening)]() mutable
		{
			if (Late.IsValid()) Open = Late.Get();
			if (Open.id != 0) troupe_crowd_close(Open);
		});
	Crowd = {};
	bHasPose = false;
	Super::EndPlay(Reason);
}
