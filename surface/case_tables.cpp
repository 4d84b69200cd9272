#include "surface/case_tables.h"

namespace isobrick::inline v0 {

constinit const CaseTables kCaseTables = make_case_tables();
constinit const CaseTables kMirroredCaseTables = mirrored(make_case_tables());

}  // namespace isobrick
