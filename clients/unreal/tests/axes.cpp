// Holds the conversions of the Unreal plugin against the table of known poses: axes POSES.JSON
#include "../Source/Troupe/Public/TroupeAxes.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

using namespace TroupeAxes;

// The numbers of a part of a pose, such as those of "position" in "unreal".
template <size_t Count>
static std::array<double, Count> Numbers(const std::string &Row, const std::string &Frame, const std::string &Part)
{
	size_t At = Row.find("[", Row.find("\"" + Part + "\"", Row.find("\"" + Frame + "\"")));
	std::array<double, Count> All;
	for (double &One : All)
	{
		char *End;
		One = std::strtod(&Row[At + 1], &End);
		At = size_t(End - Row.data());
	}
	return All;
}

static bool Near(double A, double B) { return std::abs(A - B) < 1e-5; }

int main(int, char **Arguments)
{
	std::ifstream Table(Arguments[1]);
	int Rows = 0, Wrong = 0;
	for (std::string Row; std::getline(Table, Row);)
	{
		if (Row[0] != '{') continue;
		auto P = Numbers<3>(Row, "troupe", "position"), P2 = Numbers<3>(Row, "unreal", "position");
		auto Q = Numbers<4>(Row, "troupe", "rotation"), Q2 = Numbers<4>(Row, "unreal", "rotation");
		TVec3<double> There = PositionToUnreal<double>({P[0], P[1], P[2]}), Back = PositionToTroupe(There);
		TQuat4<double> Turned = RotationToUnreal<double>({Q[0], Q[1], Q[2], Q[3]}), Again = RotationToTroupe(Turned);
		bool Holds = Near(There.X, P2[0]) && Near(There.Y, P2[1]) && Near(There.Z, P2[2]);
		Holds = Holds && Near(Back.X, P[0]) && Near(Back.Y, P[1]) && Near(Back.Z, P[2]);
		Holds = Holds && Near(Turned.X, Q2[0]) && Near(Turned.Y, Q2[1]) && Near(Turned.Z, Q2[2]) && Near(Turned.W, Q2[3]);
		Holds = Holds && Near(Again.X, Q[0]) && Near(Again.Y, Q[1]) && Near(Again.Z, Q[2]) && Near(Again.W, Q[3]);
		if (!Holds) std::fprintf(stderr, "not as the table says: %s\n", Row.c_str());
		Rows++;
		Wrong += !Holds;
	}
	static_assert(YawToUnreal(1.0) < 0 && HeadingToTroupe(90.0) < 0);
	std::printf("%d poses in Unreal's frame\n", Rows);
	return Wrong == 0 && Rows >= 8 ? 0 : 1;
}
