using UnrealBuildTool;

// The node in the editor of animation graphs.
public class TroupeEditor : ModuleRules
{
	public TroupeEditor(ReadOnlyTargetRules Target) : base(Target)
	{
		PCHUsage = PCHUsageMode.UseExplicitOrSharedPCHs;
		PrivateDependencyModuleNames.AddRange(
			new[] { "Core", "CoreUObject", "Engine", "AnimGraph", "AnimGraphRuntime", "BlueprintGraph", "Troupe" });
	}
}
