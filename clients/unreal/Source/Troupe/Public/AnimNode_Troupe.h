// The node of an animation graph that shows what UTroupeComponent reads.
#pragma once

#include "Animation/AnimNodeBase.h"
#include "TroupeComponent.h"

#include "AnimNode_Troupe.generated.h"

USTRUCT(BlueprintInternalUseOnly)
struct TROUPE_API FAnimNode_Troupe : public FAnimNode_Base
{
	GENERATED_BODY()

	virtual bool HasPreUpdate() const override { return true; }
	virtual void PreUpdate(const UAnimInstance* Instance) override;
	virtual void Evaluate_AnyThread(FPoseContext& Output) override;

private:
	/** A copy for the animation's threads. */
	FTroupePose Pose;
	bool bHasPose = false;
};
