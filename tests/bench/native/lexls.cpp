// Calls LexLS's equality solver (Dimitrov, Sherikov and Wieber 2015) in a loop, as a C++ user would: one object for all
// problems of a shape, data copied in, factorized, solved. Compiled by the benchmark against a checkout that the user names.

#include <lexls/lexlse.h>

#include <exception>
#include <vector>

// Solves `count` problems of one shape, `repeats` times over. data: for each problem [A, b] (M, n + 1) by columns; rows: of
// each level (p). least_norm: 0 for solve(), which returns a basic solution, 1 or 2 for solveLeastNorm_1() or _2().
// Fills x (count, n). Returns 0, or 1 when LexLS threw.
extern "C" int lexls_loop(long repeats, long count, long M, long n, long p, const long *rows, const double *data,
                          long least_norm, double *x)
{
    try
    {
        std::vector<LexLS::Index> dimensions(rows, rows + p);
        LexLS::internal::LexLSE solver(n, p, dimensions.data());
        std::vector<LexLS::dMatrixType> problems;
        for (long i = 0; i < count; i++)
            problems.emplace_back(Eigen::Map<const LexLS::dMatrixType>(data + i * M * (n + 1), M, n + 1));
        for (long turn = 0; turn < repeats; turn++)
        {
            for (long i = 0; i < count; i++)
            {
                solver.reset();
                solver.setProblem(problems[i]);
                solver.factorize();
                if (least_norm == 1) solver.solveLeastNorm_1();
                else if (least_norm == 2) solver.solveLeastNorm_2();
                else solver.solve();
                Eigen::Map<LexLS::dVectorType>(x + i * n, n) = solver.get_x();
            }
        }
    }
    catch (const std::exception &)
    {
        return 1;
    }
    return 0;
}
