#include "AnimNode_Troupe.h"

#include "Animation/AnimInstance.h"
#include "GameFramework/Actor.h"

void FAnimNode_Troupe::PreUpdate(const UAnimInstance* Instance)
{
	const AActor* Owner = Instance->GetOwningActor();
	const UTroupeComponent* Component = Owner ? Owner->FindComponentByClass<UTroupeComponent>() : nullptr;
	bHasPose = Component && Component->GetPose(Pose);
}

void FAnimNode_Troupe::Evaluate_AnyThread(FPoseContext& Output)
{
	Output.ResetToRefPose();
	if (!bHasPose) return;
	const FBoneContainer& Bones = Output.Pose.GetBoneContainer();
	for (int32 Joint = 0; Joint < Pose.Names.Num(); Joint++)
	{
		const int32 InMesh = Bones.GetReferenceSkeleton().FindBoneIndex(Pose.Names[Joint]);
		if (InMesh == INDEX_NONE) continue;
		const FCompactPoseBoneIndex Bone = Bones.MakeCompactPoseIndex(FMeshPoseBoneIndex(InMesh));
		if (Bone == INDEX_NONE) continue; // left out at this level of detail
		FTransform& Local = Output.Pose[Bone];
		Local.SetRotation(Pose.Rotations[Joint]);
		if (Joint > 0) continue;
		// The first joint is in the frame of the mesh: its parents are taken out.
		Local.SetTranslation(Pose.Root);
		FTransform Above = FTransform::Identity;
		for (auto Up = Bones.GetParentBoneIndex(Bone); Up != INDEX_NONE; Up = Bones.GetParentBoneIndex(Up))
		{
			Above = Above * Output.Pose[Up];
		}
		Local = Local.GetRelativeTransform(Above);
	}
	Output.Pose.NormalizeRotations();
}
