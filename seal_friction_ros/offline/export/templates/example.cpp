// ${mark}: as example.c, with the estimator as an object.
#include "${name}.h"
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

class Estimator
{
public:
    Estimator() { ${name}_init(&state_); }

    std::optional<${name}_answers> step(const ${name}_loop_sample & sample)
    {
        ${name}_answers answers{};
        if (!${name}_step(&state_, &sample, &answers)) return std::nullopt;
        return answers;
    }

private:
    ${name}_pipeline_state state_;
};

int main(int argc, char ** argv)
{
    std::ifstream file(argc > 1 ? argv[1] : "example.csv");
    std::string line, cell;
    if (!std::getline(file, line)) return 2;  // the first line has the names
    Estimator estimator;
    std::printf("stamp,friction_force,coulomb_friction,coulomb_friction_std,state,status,feedforward_force\n");
    while (std::getline(file, line)) {
        if (line.find(',') == std::string::npos) continue;
        std::istringstream cells(line);
        std::getline(cells, cell, ',');
        const bool is_real = cell.find_first_of(".eE") != std::string::npos;  // 1e9, too
        const char * first = cell.c_str();
        const int64_t stamp = is_real ? std::llround(std::strtod(first, nullptr)) : std::strtoll(first, nullptr, 10);
        std::vector<double> v;
        while (std::getline(cells, cell, ',')) {
            char * end;
            const double value = std::strtod(cell.c_str(), &end);
            v.push_back(end == cell.c_str() ? NAN : value);
        }
        v.resize(7, NAN);
        const auto answers = estimator.step({stamp, v[0], v[1], v[2], v[3], v[4], v[5], v[6]});
        if (!answers) return 1;
        const auto & found = answers->friction_estimate;
        std::printf("%" PRId64 ",%.17g,%.17g,%.17g,%" PRId64 ",%" PRId64 ",%.17g\n", found.stamp, found.friction_force,
                    found.coulomb_friction, found.coulomb_friction_std, found.state, found.status,
                    answers->has_feed_forward ? answers->feed_forward.force : 0.0);
    }
}
