// A scene compiled by MuJoCo from MJCF, for native tests that step one. MuJoCo's own library comes
// from its Python wheel and is not instrumented; what calls it is.
#pragma once

#include <mujoco/mujoco.h>

#include <stdexcept>
#include <string>

// A diverging run is what is tried. Set before there are threads.
inline const bool silent = (mju_user_warning = [](const char*) {}, true);

class Scene {
 public:
  explicit Scene(const std::string& xml) {
    char error[512] = "";
    mjSpec* spec = mj_parseXMLString(xml.c_str(), nullptr, error, sizeof error);
    if (spec) model = mj_compile(spec, nullptr);
    if (!model) throw std::runtime_error("MuJoCo: " + std::string(error) + mjs_getError(spec));
    mj_deleteSpec(spec);
    data = mj_makeData(model);
  }
  ~Scene() { mj_deleteData(data), mj_deleteModel(model); }
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  int id(mjtObj kind, const std::string& name) const {
    const int found = mj_name2id(model, kind, name.c_str());
    if (found < 0) throw std::runtime_error("no " + name);
    return found;
  }

  mjModel* model = nullptr;
  mjData* data = nullptr;
};
