using System.IO;
using UnrealBuildTool;

// ThirdParty/troupe has troupe.h and the library of `cargo build --release -p troupe-c`; docs/tutorials/unreal.md says how they get there.
public class Troupe : ModuleRules
{
	public Troupe(ReadOnlyTargetRules Target) : base(Target)
	{
		PCHUsage = PCHUsageMode.UseExplicitOrSharedPCHs;
		PublicDependencyModuleNames.AddRange(new[] { "Core", "CoreUObject", "Engine" });
		PrivateDependencyModuleNames.AddRange(new[] { "HTTP", "Json" });

		string Library = Path.Combine(PluginDirectory, "ThirdParty", "troupe");
		PublicIncludePaths.Add(Library);
		string File = Target.Platform == UnrealTargetPlatform.Win64 ? "troupe_c.lib" : "libtroupe_c.a";
		PublicAdditionalLibraries.Add(Path.Combine(Library, File));
		if (Target.Platform == UnrealTargetPlatform.Win64)
		{
			// What Rust's standard library and its sockets and certificates need.
			PublicSystemLibraries.AddRange(new[] { "ws2_32.lib", "userenv.lib", "ntdll.lib", "bcrypt.lib", "crypt32.lib" });
		}
	}
}
