// A character that a Troupe server moves.
#pragma once

#include "Async/Future.h"
#include "Components/ActorComponent.h"
#include "CoreMinimal.h"

#include "troupe.h"

#include "TroupeComponent.generated.h"

/** The newest pose of a character, in Unreal's axes and in the frame of its mesh. */
struct FTroupePose
{
	/** Place of the first joint, centimetres. */
	FVector Root = FVector::ZeroVector;
	/** Names of the joints. They do not change. */
	TArray<FName> Names;
	/** Rotations: of the first in the frame of the mesh, of the others relative to their parents. */
	TArray<FQuat> Rotations;
};

/**
 * Opens a crowd of one character that wears the skeleton of the owner's mesh, and keeps its newest pose for FAnimNode_Troupe.
 * The character walks in the frame that the mesh has at the start: leave the actor at its place. Connecting waits for the server,
 * so it happens in a thread of its own.
 */
UCLASS(ClassGroup = (Animation), meta = (BlueprintSpawnableComponent))
class TROUPE_API UTroupeComponent : public UActorComponent
{
	GENERATED_BODY()

public:
	UTroupeComponent();

	/** Address of the server. */
	UPROPERTY(EditAnywhere, Category = "Troupe")
	FString Server = TEXT("http://127.0.0.1:8080");

	/** Name of the skeleton on the server. The mesh's reference pose is uploaded under it. */
	UPROPERTY(EditAnywhere, Category = "Troupe")
	FString SkeletonName = TEXT("unreal-character");

	/** The bone that is the first joint. Its parents keep the reference pose. */
	UPROPERTY(EditAnywhere, Category = "Troupe")
	FName RootBone = TEXT("pelvis");

	/** Yaw of the way that the mesh faces, degrees. Epic's meshes face +Y: 90. */
	UPROPERTY(EditAnywhere, Category = "Troupe")
	float MeshYaw = 90;

	/** Ahead and to the right of the mesh at the start, centimetres a second. An empty style keeps the current one. */
	UFUNCTION(BlueprintCallable, Category = "Troupe")
	void Move(float Ahead, float Right, const FString& Style);

	/** The newest pose. False: none has come. */
	bool GetPose(FTroupePose& Out) const;

	virtual void BeginPlay() override;
	virtual void EndPlay(const EEndPlayReason::Type Reason) override;
	virtual void TickComponent(float Seconds, ELevelTick Type, FActorComponentTickFunction* Function) override;

private:
	FString Joints();
	void Open();
	FQuat Facing() const;

	FTroupePose Pose;
	bool bHasPose = false;
	bool bEnded = false;
	TFuture<TroupeCrowd> Opening;
	TroupeCrowd Crowd{};
};
