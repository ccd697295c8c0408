#include "server/wings.h"

#ifdef ISOMESH_HOSPITAL
#include "server/hospital/hospital.h"
#else
#include "proto/error.h"
#endif

namespace isomesh {
namespace {

http::WingEntry the_hospital() {
  http::WingEntry entry;
  entry.option = "hospital";
  entry.help =
      "File of PACS and rules (TOML): orders fetch images from these PACS and send meshes to them";
#ifdef ISOMESH_HOSPITAL
  entry.tables = hospital::tables();
  entry.check = hospital::check;
  entry.open = hospital::open;
#else
  entry.check = [](const std::filesystem::path& /*file*/) -> http::ConfiguredFiles {
    throw invalid_parameter("hospital", "is not known to this isomeshd: it was built without");
  };
  entry.open = [check = entry.check](const http::WingSettings& settings,
                                     const http::WingServices& /*services*/) {
    if (!settings.file.empty()) check(settings.file);
    return std::unique_ptr<http::Wing>();
  };
#endif
  return entry;
}

}  // namespace

const http::WingEntry& wing_entry() {
  static const http::WingEntry entry = the_hospital();
  return entry;
}

}  // namespace isomesh
