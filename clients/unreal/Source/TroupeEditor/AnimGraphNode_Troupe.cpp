#include "AnimGraphNode_Troupe.h"

#include "Modules/ModuleManager.h"

IMPLEMENT_MODULE(FDefaultModuleImpl, TroupeEditor)
