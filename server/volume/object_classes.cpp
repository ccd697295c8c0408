#include "server/volume/object_classes.h"

#include <algorithm>
#include <array>

namespace isomesh::volume {
namespace {

struct ObjectKind {
  std::string_view sop_class;  // after 1.2.840.10008.5.1.4.1.1. (PS3.4, B.5)
  bool is_family;              // includes all classes below it
  std::string_view what;
};

constexpr std::string_view kStorage = "1.2.840.10008.5.1.4.1.1.";

constexpr std::array kKinds = {
    ObjectKind{"66", false, "raw data"},
    ObjectKind{"66.1", false, "a spatial registration"},
    ObjectKind{"66.2", false, "a set of spatial fiducials"},
    ObjectKind{"66.3", false, "a deformable spatial registration"},
    ObjectKind{"66.5", false, "a surface segmentation"},
    ObjectKind{"66.6", false, "a tractography result"},
    ObjectKind{"67", false, "a real world value mapping"},
    ObjectKind{"11", true, "a presentation state"},
    ObjectKind{"88", true, "a report"},
    ObjectKind{"104", true, "an encapsulated document"},
    ObjectKind{"9", true, "a waveform"},
    ObjectKind{"4.2", false, "a spectroscopy"},
    ObjectKind{"481.3", false, "a structure set"},
    ObjectKind{"481.4", false, "a treatment record"},
    ObjectKind{"481.5", false, "a treatment plan"},
    ObjectKind{"481.6", false, "a treatment record"},
    ObjectKind{"481.7", false, "a treatment record"},
    ObjectKind{"481.8", false, "a treatment plan"},
    ObjectKind{"481.9", false, "a treatment record"},
};

}  // namespace

std::optional<std::string_view> kind_without_images(std::string_view sop_class) {
  if (!sop_class.starts_with(kStorage)) return std::nullopt;
  sop_class.remove_prefix(kStorage.size());
  const auto* found = std::ranges::find_if(kKinds, [&](const ObjectKind& kind) {
    if (!sop_class.starts_with(kind.sop_class)) return false;
    const std::string_view rest = sop_class.substr(kind.sop_class.size());
    return rest.empty() || (kind.is_family && rest.front() == '.');
  });
  if (found == kKinds.end()) return std::nullopt;
  return found->what;
}

}  // namespace isomesh::volume
