#include <array>

#include "client/cli/option_groups.h"

namespace isomesh::cli {
namespace {

struct Examples {
  std::string_view command;
  std::string_view lines;
};

constexpr std::string_view kMesh = R"(
  isomesh mesh head.nii.gz --iso 60 -o head.drc
  isomesh mesh ct-series/ --iso bone --passes 10 -o bone.glb -o bone.stl
  isomesh mesh organs.seg.nrrd --labels all -o organs.glb
  isomesh mesh organs.seg.nrrd --labels 1,3-5 -o organs.zip
  isomesh mesh scans/*.nii.gz --iso otsu -o meshes/ --format glb --jobs 4
  isomesh mesh sub-*/anat/T1.nii.gz --iso otsu --skip-existing \
      -o 'meshes/{folder}/{name}.stl'
  isomesh mesh ct.raw --dims 512,512,300 --type int16 --spacing 0.7,0.7,1 \
      --iso 300 -o ct.stl
  isomesh mesh 3f2a91c0 --iso 60 -o head.stl    # a stored volume, by its id
  isomesh mesh head.nii.gz --iso 60 --dry-run
)";

constexpr std::string_view kLocal = R"(
  isomesh local head.nii.gz --iso 60 -o head.stl
  isomesh local scans/*.nii.gz --iso otsu -o meshes/ --format glb --jobs 4
  zcat head.nii.gz | isomesh local - --iso 60 -o - --format stl >head.stl
)";

constexpr std::array kExamples = {
    Examples{"mesh", kMesh},
    Examples{"local", kLocal},
    Examples{"upload", R"(
  isomesh upload head.nii.gz
  isomesh upload ct-series/ --name "CT of the knee"
  isomesh upload ct.raw --dims 512,512,300 --type int16 --spacing 0.7,0.7,1
)"},
    Examples{"submit", R"(
  isomesh submit 3f2a91c0 --iso 60 --format drc,stl
  isomesh submit $(isomesh upload head.nii.gz) --iso otsu --key head-1
)"},
    Examples{"estimate", R"(
  isomesh estimate 3f2a91c0 --iso 60 --format stl
)"},
    Examples{"status", R"(
  isomesh status 0192e4b1-77c3
  isomesh --json status 0192e4b1-77c3
)"},
    Examples{"wait", R"(
  isomesh wait $(isomesh submit 3f2a91c0 --iso 60)
)"},
    Examples{"fetch", R"(
  isomesh fetch 0192e4b1-77c3 -o head.drc
  isomesh fetch 0192e4b1-77c3 --label 3 -o liver.stl
)"},
    Examples{"cancel", R"(
  isomesh cancel 0192e4b1-77c3
)"},
    Examples{"report", R"(
  isomesh report 0192e4b1-77c3 -o report.json
)"},
    Examples{"rename", R"(
  isomesh rename 3f2a91c0 "CT of the knee"
)"},
    Examples{"reorient", R"(
  isomesh reorient 3f2a91c0 --axes=-x,y,z
)"},
    Examples{"erase", R"(
  isomesh erase 3f2a91c0 77b01d2e
  isomesh erase --with-jobs 3f2a91c0
  isomesh erase --jobs 0192e4b1-77c3
)"},
    Examples{"list", R"(
  isomesh list --state running
  isomesh list --volume 3f2a91c0 --since 2026-11-20
  isomesh list --volumes
)"},
    Examples{"info", R"(
  isomesh info 3f2a91c0
)"},
    Examples{"labels", R"(
  isomesh labels 3f2a91c0
)"},
    Examples{"walls", R"(
  isomesh walls 0192e4b1-77c3
)"},
    Examples{"completion", R"(
  isomesh completion bash >~/.local/share/bash-completion/completions/isomesh
  isomesh completion zsh >~/.zfunc/_isomesh
  isomesh completion fish >~/.config/fish/completions/isomesh.fish
)"},
};

}  // namespace

std::string general_examples() {
  return R"(  isomesh mesh head.nii.gz --iso 60 -o head.drc
  isomesh mesh ct-series/ --iso bone --passes 10 -o bone.glb -o bone.stl
  isomesh mesh organs.seg.nrrd --labels all -o organs.glb
  isomesh local head.nii.gz --iso 60 -o head.stl
  isomesh submit $(isomesh upload head.nii.gz) --iso 60 --format drc,stl
  isomesh --server https://meshes.example.org list
)";
}

std::string examples_of(std::string_view command) {
  for (const Examples& each : kExamples) {
    if (each.command == command) return std::string(each.lines.substr(1));
  }
  return {};
}

}  // namespace isomesh::cli
