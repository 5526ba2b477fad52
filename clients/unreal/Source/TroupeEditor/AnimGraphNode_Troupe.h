#pragma once

#include "AnimGraphNode_Base.h"
#include "AnimNode_Troupe.h"

#include "AnimGraphNode_Troupe.generated.h"

/** FAnimNode_Troupe in an animation graph. */
UCLASS()
class UAnimGraphNode_Troupe : public UAnimGraphNode_Base
{
	GENERATED_BODY()

public:
	UPROPERTY(EditAnywhere, Category = "Troupe")
	FAnimNode_Troupe Node;

	virtual FText GetNodeTitle(ENodeTitleType::Type) const override { return FText::FromString(TEXT("Troupe")); }
	virtual FText GetTooltipText() const override
	{
		return FText::FromString(TEXT("The pose that the owner's Troupe component reads from the server"));
	}
};
