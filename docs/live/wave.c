/* The exact solitary wave of a peak: m c^2 r = K T(r), with K the convolution with the tent of one
   site, as in `tensegrity.waves.travelling`.  Unknown are the values of an even profile at POINTS
   + 1 places of a half-line, over the peak, and mu = m c^2 peak/T(peak); sweeps of the equation
   begin, Newton's method ends. */

#define POINTS 128
#define SWEEPS 60
#define NEWTONS 20
#define ENOUGH 1e-7          /* last step, over the peak: the next would be its square */
#define LEFT 1e-3            /* of the peak at the end of the half-line: more is no solitary wave */
#define CORE 2.0             /* sites in which a wave has fallen to its linear tail */
#define FAINT 14.0           /* decades of e that the tail falls then */
#define FARTHEST 60.0        /* sites */

static real profile[POINTS + 1], drive[POINTS + 1], rates[POINTS + 1], half_length;
static real square[POINTS + 1][POINTS + 1], mean[POINTS + 1][POINTS + 1];
static real table[POINTS + 2][POINTS + 3];

EXPORT(wave_points) int wave_points(void) { return POINTS; }
EXPORT(wave_elongation) real *wave_elongation(void) { return profile; }
EXPORT(wave_velocity) real *wave_velocity(void) { return rates; }
EXPORT(wave_reach) real wave_reach(void) { return half_length; }

/* Decay per site of the tail of a wave so many times as fast as sound: sinh(y)/y, y = half of it. */
static real decay(real ratio)
{
    real low = 0, high = 20;
    for (int k = 0; k < 60; k++) {
        const real y = (low + high) / 2;
        if (sinh(y) < ratio * y) low = y;
        else high = y;
    }
    return low + high;
}

/* The mean over a site, and its square K, between even functions on the half-line. */
static void lay_matrices(void)
{
    static real cosine[2 * POINTS], one[2 * POINTS], two[2 * POINTS];
    for (int m = 0; m < 2 * POINTS; m++) cosine[m] = cos(m * (3.14159265358979323846 / POINTS));
    for (int m = 0; m < 2 * POINTS; m++) one[m] = two[m] = 0;
    for (int n = 0; n <= POINTS; n++) {
        const real y = n * 3.14159265358979323846 / (2 * half_length);
        const real symbol = n ? sin(y) / y : 1, weight = (n % POINTS ? 1.0 : 0.5) / POINTS;
        for (int m = 0; m < 2 * POINTS; m++) {
            const real wave = weight * symbol * cosine[n * m % (2 * POINTS)];
            one[m] += wave;
            two[m] += symbol * wave;
        }
    }
    for (int i = 0; i <= POINTS; i++)
        for (int j = 0; j <= POINTS; j++) {
            const int near = i > j ? i - j : j - i, far = (i + j) % (2 * POINTS);
            const real weight = j % POINTS ? 1 : 0.5;
            mean[i][j] = weight * (one[near] + one[far]);
            square[i][j] = weight * (two[near] + two[far]);
        }
}

static real times(const real *row)
{
    real sum = 0;
    for (int j = 0; j <= POINTS; j++) sum += row[j] * drive[j];
    return sum;
}

/* Solve for the last column of `table`, by elimination with row exchanges; 0 where singular. */
static int solved(real *x)
{
    const int n = POINTS + 2;
    for (int k = 0; k < n; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(table[i][k]) > fabs(table[best][k])) best = i;
        if (!(fabs(table[best][k]) > 1e-300)) return 0;
        for (int j = k; best != k && j <= n; j++) {
            const real saved = table[k][j];
            table[k][j] = table[best][j], table[best][j] = saved;
        }
        for (int i = k + 1; i < n; i++) {
            const real weight = table[i][k] / table[k][k];
            if (weight != 0)
                for (int j = k + 1; j <= n; j++) table[i][j] -= weight * table[k][j];
        }
    }
    for (int i = n - 1; i >= 0; i--) {
        x[i] = table[i][n];
        for (int j = i + 1; j < n; j++) x[i] -= table[i][j] * x[j];
        x[i] /= table[i][i];
    }
    return 1;
}

/* Speed [sites/s] of the exact wave of a segment's springs whose peak has this elongation, for
   masses of 1 kg; 0 where none was found. */
EXPORT(wave) real wave(int segment, real peak)
{
    static real step[POINTS + 2];
    const real load = value(segment, 1, peak), rest = value(segment, 2, 0);
    const real low = domain[segment][0] / peak, high = domain[segment][1] / peak;
    const real slow = 2 * (peak * load - value(segment, 0, peak)); /* of waves that are long */
    if (!(load * peak > 0 && slow > 0 && rest > 0)) return 0;
    const real falls = smaller(decay(larger(sqrt(load * load / slow / rest), 1 + 1e-9)), 12);
    half_length = smaller(CORE + FAINT / falls, FARTHEST);
    lay_matrices();
    for (int i = 0; i <= POINTS; i++)
        profile[i] = 1 / pow(cosh(falls * i * half_length / POINTS / 2), 2.0);
    for (int k = 0; k < SWEEPS; k++) {
        real moved = 0;
        for (int j = 0; j <= POINTS; j++) drive[j] = value(segment, 1, peak * profile[j]) / load;
        const real top = times(square[0]);
        for (int i = 0; i <= POINTS; i++) {
            const real next = times(square[i]) / top;
            moved = larger(moved, fabs(next - profile[i]));
            profile[i] = next;
        }
        if (!(moved >= 1e-2)) break;
    }
    for (int j = 0; j <= POINTS; j++) drive[j] = value(segment, 1, peak * profile[j]) / load;
    real mu = times(square[0]), size = 1;
    for (int k = 0; k < NEWTONS && size >= ENOUGH; k++) {
        for (int j = 0; j <= POINTS; j++) drive[j] = value(segment, 1, peak * profile[j]) / load;
        for (int i = 0; i <= POINTS; i++) table[i][POINTS + 2] = times(square[i]) - mu * profile[i];
        for (int j = 0; j <= POINTS; j++) {
            const real slope = value(segment, 2, peak * profile[j]) * peak / load;
            for (int i = 0; i <= POINTS; i++) table[i][j] = -square[i][j] * slope + (i == j ? mu : 0);
            table[j][POINTS + 1] = profile[j];
            table[POINTS + 1][j] = j == 0;
        }
        table[POINTS + 1][POINTS + 1] = 0;
        table[POINTS + 1][POINTS + 2] = 1 - profile[0];
        if (!solved(step)) return 0;
        real part = 1;
        for (int j = 0; j <= POINTS; j++) /* within the domain, whose ends are low and high */
            while (part > 1e-9 && !(profile[j] + part * step[j] < (peak < 0 ? low : high)
                                    && profile[j] + part * step[j] > (peak < 0 ? high : low)))
                part /= 2;
        size = fabs(step[POINTS + 1] / mu);
        for (int j = 0; j <= POINTS; j++) {
            profile[j] += part * step[j];
            size = larger(size, fabs(step[j]));
        }
        mu += part * step[POINTS + 1];
    }
    const real fast = mu * load / peak;
    if (!(size < ENOUGH && fast > rest && fabs(profile[POINTS]) < LEFT)) return 0;
    for (int i = 0; i <= POINTS; i++) rates[i] = -sqrt(fast) / mu * times(mean[i]);
    return sqrt(fast);
}

/* Energy [J] of the wave found last, which had this peak: kinetic and potential, by the trapezoidal
   rule over its profile. */
EXPORT(wave_energy) real wave_energy(int segment, real peak)
{
    real sum = 0;
    for (int i = 0; i <= POINTS; i++) {
        const real speed = peak * rates[i], weight = i % POINTS ? 2 : 1;
        sum += weight * (speed * speed / 2 + value(segment, 0, peak * profile[i]));
    }
    return sum * half_length / POINTS;
}
